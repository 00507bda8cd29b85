"""What is fitted to scored cases: how probabilities follow from evidence, and what each kind of wrong verdict costs."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.causes import Hypothesis


@dataclass(frozen=True)
class Calibration:
    """Numbers of `calibration.json`."""

    #: Divisor of log probabilities: the evidence is overconfident where noise, mesh and tissue are only nearly as the
    #: model has them.
    temperature: float
    losses: Mapping[str, float]  # what each kind of wrong verdict costs, in units of silence where something is missing
    most_said: float  # share of names that were right among scored cases: no higher probability is reported

    def probabilities(self, hypotheses: Sequence[Hypothesis]) -> Floats:
        """Of each hypothesis, (h,)."""
        from scipy.special import softmax

        logs = [h.log_evidence + h.log_prior for h in hypotheses]
        return np.asarray(softmax(np.array(logs) / self.temperature))


@cache
def calibration() -> Calibration:
    """The calibration that the package has."""
    values = json.loads((files("warpbrain.inference") / "calibration.json").read_text(encoding="utf-8"))
    return Calibration(values["temperature"], values["losses"], values["most_said"])


def percent(probability: float) -> str:
    """A probability in percent; beyond `Calibration.most_said` it is only said to be beyond."""
    most = calibration().most_said
    if probability > most:
        return f"above {100.0 * most:g} %"
    if probability < 1.0 - most:
        return f"below {100.0 * (1.0 - most):g} %"
    return f"{100.0 * probability:.0f} %"
