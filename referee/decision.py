"""The verdict of least expected loss by the tool's table: of the optimal analyst, and to price false names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from referee.diagnoses import NOT_PHYSICS, UNKNOWN
from warpbrain.inference.decide import Truth, decisions, loss

#: Probabilities of sets of causes: names of mechanisms and `UNKNOWN`, or `NOT_PHYSICS` alone; the empty set is that
#: nothing acts.
Posterior = Mapping[frozenset[str], float]


@dataclass(frozen=True)
class Decision:
    """A verdict with the causes that it names or holds to be possible, and the probability that they act."""

    verdict: str
    causes: tuple[str, ...]
    probability: float


def decide(posterior: Posterior, losses: Mapping[str, float]) -> Decision:
    """The verdict of least expected loss; `losses` as in the tool's `calibration.json`."""
    truths = [Truth(true - {UNKNOWN, NOT_PHYSICS}, UNKNOWN in true, true & {NOT_PHYSICS}) for true in posterior]
    p = np.array(list(posterior.values()))
    compared = decisions(truths, p)
    best = compared[int(np.argmin([p @ [loss(one, truth, losses) for truth in truths] for one in compared]))]
    # what is no physics is one cause here, and no name
    causes = () if best.verdict == NOT_PHYSICS else best.causes
    return Decision(best.verdict, causes, sum(p for true, p in posterior.items() if set(causes) <= true))
