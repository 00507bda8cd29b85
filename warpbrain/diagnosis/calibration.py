"""From log evidence to probabilities that are right as often as they say.

Evidence is sharper than it should be where the model of noise, mesh and tissue is only nearly right. So it is divided
by a temperature, and the unknown has an offset; both are of calibration cases that no score is taken of.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

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
    kinds = tuple(log_evidence)
    weights = weighed(kinds, np.array([[log_evidence[kind]] for kind in kinds]), alternatives)
    return dict(zip(kinds, weights[:, 0].tolist(), strict=True))


def weighed(kinds: Sequence[str], log_evidence: Floats, alternatives: frozenset[str]) -> Floats:
    """The same of many cases: from log evidence (kinds, b) to probabilities (kinds, b)."""
    from scipy.special import softmax

    offset = dict.fromkeys(alternatives, ALTERNATIVE_OFFSET) | {"unknown": UNKNOWN_OFFSET}
    offsets = np.array([[offset.get(kind, 0.0)] for kind in kinds])
    return np.asarray(softmax((log_evidence + offsets) / TEMPERATURE, axis=0))
