"""What the referee has fitted: how probabilities follow from evidence, and what each kind of wrong verdict costs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from warpbrain.inference.causes import Kind
from warpbrain.inference.subsets import Hypothesis


@dataclass(frozen=True)
class Calibration:
    """Numbers of `calibration.json`.

    Attributes
    ----------
    temperature : float
        By which log probabilities are divided: evidence is sharper than it should be where noise, mesh and tissue are
        only nearly what the model says.
    log_weights : mapping of str to float
        Added to the log prior of sets: of no cause (`nothing`), for each physical cause beyond the first (`another`),
        of sets with the unknown, and of sets with what is no physics.
    losses : mapping of str to float
        What each kind of wrong verdict costs, in units of silence where something is missing.
    """

    temperature: float
    log_weights: Mapping[str, float]
    losses: Mapping[str, float]

    def probabilities(self, hypotheses: Sequence[Hypothesis]) -> NDArray[np.float64]:
        """Of each hypothesis, (h,)."""
        from scipy.special import softmax

        logs = [one.log_evidence + one.log_prior + self._weight(one) for one in hypotheses]
        return np.asarray(softmax(np.array(logs) / self.temperature))

    def _weight(self, hypothesis: Hypothesis) -> float:
        if not hypothesis.causes:
            return self.log_weights["nothing"]
        kinds = hypothesis.kinds
        physical = kinds.count(Kind.PHYSICS)
        weight = self.log_weights["another"] * max(physical - 1, 0)
        for kind in (Kind.UNKNOWN, Kind.NOT_PHYSICS):
            weight += self.log_weights[kind.value] * (kind in kinds)
        return weight


@cache
def calibration() -> Calibration:
    """Those of the package."""
    read = json.loads((files("warpbrain.inference") / "calibration.json").read_text(encoding="utf-8"))
    return Calibration(read["temperature"], read["log_weights"], read["losses"])
