"""Whether each thing that was added is needed by the rest: it must predict held-out tests, and better than placebos.

It is judged where everything else that was added stands: a mechanism that is one of several explains little alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpbrain.diagnosis.held_out import Predicted
from warpbrain.diagnosis.specimen.fitting import Fitting, SpecimenFit
from warpbrain.diagnosis.specimen.folds import Folds, held_out, placebos
from warpbrain.diagnosis.specimen.forward import Hypothesis
from warpbrain.diagnosis.verdict import PLACEBO


@dataclass(frozen=True)
class Confirmation:
    """What a kind is worth to the final fit.

    Attributes
    ----------
    kind : str
    log_evidence : float
        Of the final fit against the fit without the kind.
    gain : (part, low, high)
        Of the held-out error without it that is gone, and its 95 % interval.
    placebo_p : float
        Probability that a pattern that means nothing does as well in its place.
    """

    kind: str
    log_evidence: float
    gain: tuple[float, float, float]
    placebo_p: float

    @property
    def why_not(self) -> str:
        """What keeps it from being named; empty if nothing does."""
        said = []
        if self.gain[1] <= 0.0:
            said.append("tests that were held out are not predicted better with it")
        if self.placebo_p > PLACEBO:
            said.append("patterns that mean nothing predict as well")
        return " and ".join(said)


def confirm(
    fitting: Fitting, final: SpecimenFit, predicted: Predicted, folds: Folds, rng: np.random.Generator
) -> tuple[Confirmation, ...]:
    """Of each kind of physics that was added, in order.

    Parameters
    ----------
    fitting : Fitting
    final : SpecimenFit
        With everything.
    predicted : Predicted
        Of held-out tests by it.
    folds : Folds
    rng : Generator
    """
    found = []
    assumptions = final.hypothesis.assumptions
    for kind in dict.fromkeys(one.kind for one in assumptions if one.physics):
        kept = tuple(one for one in assumptions if one.kind != kind)
        begin = _without(fitting, final, kind)
        fit = fitting.fit(Hypothesis(kept), folds.fitted, [begin], final.kappa)
        if fit is None:
            continue
        others, _ = held_out(fitting, fit, folds)
        freedom = sum(len(one.mean) for one in assumptions if one.kind == kind)
        patterns = placebos(fitting, fit, folds, freedom, rng)
        placebo_p = float((1 + np.sum(patterns <= predicted.rmse)) / (1 + len(patterns)))
        gain = predicted.improvement(others, rng)
        found.append(Confirmation(kind, final.log_evidence - fit.log_evidence, gain, placebo_p))
    return tuple(found)


def _without(fitting: Fitting, final: SpecimenFit, kind: str) -> np.ndarray:
    """Coefficients of the final fit less those of a kind."""
    parts, first = [], len(fitting.forward.nuisances(final.hypothesis))
    parts.append(final.z[:first])
    for one in final.hypothesis.assumptions:
        if one.kind != kind:
            parts.append(final.z[first : first + len(one.mean)])
        first += len(one.mean)
    return np.concatenate(parts)
