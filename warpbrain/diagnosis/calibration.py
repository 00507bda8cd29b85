"""From log evidence to probabilities that are right as often as they say.

Evidence is sharper than it should be where the model of noise, mesh and tissue is only nearly right. So it is divided
by a temperature, and the unknown has an offset; both are of calibration cases that no score is taken of.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

#: Of the calibration set: temperature, and what is added to the log evidence of the unknown.
TEMPERATURE, UNKNOWN_OFFSET = 1.5, -1.0
#: What is no physics is this much less probable beforehand than a mechanism, logarithm.
ALTERNATIVE_OFFSET = -1.0


def probabilities(log_evidence: Mapping[str, float], alternatives: frozenset[str]) -> dict[str, float]:
    """Probability of each kind, if something is missing.

    Parameters
    ----------
    log_evidence : mapping
        By kind.
    alternatives : frozenset of str
        Kinds that are no physics.
    """
    from scipy.special import softmax

    kinds = list(log_evidence)
    offset = dict.fromkeys(alternatives, ALTERNATIVE_OFFSET) | {"unknown": UNKNOWN_OFFSET}
    weights = softmax(np.array([(log_evidence[k] + offset.get(k, 0.0)) / TEMPERATURE for k in kinds]))
    return dict(zip(kinds, weights.tolist(), strict=True))
