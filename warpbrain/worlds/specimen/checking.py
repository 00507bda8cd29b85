"""The checks of one set of causes put together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.causes import Kind
from warpbrain.inference.confirm import Confirmation
from warpbrain.inference.predict import Prediction
from warpbrain.recordings.agreement import root_mean_square
from warpbrain.worlds.specimen.checks import blocks_of, folds_of, held_out, p_of_nothing_left, placebo_p
from warpbrain.worlds.specimen.fit import Fit
from warpbrain.worlds.specimen.measures import score
from warpbrain.worlds.specimen.protocol import Protocol
from warpbrain.worlds.specimen.result import Score
from warpbrain.worlds.specimen.search import Sets


@dataclass(frozen=True, eq=False)
class CheckResults:
    """A fit beside the base; see `SpecimenDiagnosis` for what these are."""

    p_left: float | None
    scores: dict[str, Score]
    stresses: dict[str, Floats]
    improvement: tuple[float, float, float] | None
    confirmations: tuple[Confirmation, ...]


class Checker:
    """Checks fits of one diagnosis.

    Parameters
    ----------
    sets : Sets
    protocol : Protocol
        All recorded rows.
    draws : int
        Of rows in which nothing is left.
    random : Generator
    """

    def __init__(self, sets: Sets, protocol: Protocol, draws: int, random: np.random.Generator) -> None:
        self.sets, self.protocol, self.draws, self.random = sets, protocol, draws, random
        self.folds = folds_of(sets.base.forward.protocol)
        self._blocks = blocks_of(protocol)
        self._predicted: dict[int, tuple[Fit, Floats, Floats, float]] = {}

    def p_left(self, fit: Fit) -> float:
        """Probability of rows that other causes explain as well, if a fit has all that acts."""
        return p_of_nothing_left(self.sets.about(fit), self.draws, self.random)

    def of(self, fit: Fit) -> CheckResults:
        """Everything about a fit; of the base only its errors."""
        base = self.sets.base
        fits = {"refitted": base} if fit is base else {"refitted": base, "explained": fit}
        scores, stresses = {}, {}
        for name, own in fits.items():
            stresses[name], stresses[f"heldout {name}"], _ = self._predictions(own)
            scores[name] = score(self.protocol, stresses[name], stresses[f"heldout {name}"])
        if fit is base:
            return CheckResults(None, scores, stresses, None, ())
        kinds = {one.effect.name: one.effect.kind for one in fit.assumed}
        confirmations = [self._confirm(fit, name) for name, kind in kinds.items() if kind is Kind.PHYSICS]
        confirmed = tuple(one for one in confirmations if one is not None)
        return CheckResults(self.p_left(fit), scores, stresses, self._improvement(base, fit), confirmed)

    def heldout_rms(self, fit: Fit) -> float:
        """Of all recorded rows of tests that were held out in turn [Pa]."""
        rows = self.protocol.mask(self.protocol.to_fit)
        return root_mean_square((self.protocol.observed - self._predictions(fit)[1])[rows])

    def _predictions(self, fit: Fit) -> tuple[Floats, Floats, float]:
        """Stress of a fit and held-out stress at all recorded rows [Pa], and held-out log density."""
        if id(fit) not in self._predicted:
            whole = fit.forward.of(self.protocol, law=fit.forward.law).stress(fit.assumed, fit.z)
            predicted, log_density = held_out(fit, self.folds)
            # of thinned rows it is known by how much it differs from the fit: smoothly
            held = whole + self.protocol.spread(predicted - fit.stress, fit.forward.protocol)
            self._predicted[id(fit)] = fit, whole, held, log_density
        return self._predicted[id(fit)][1:]

    def _improvement(self, before: Fit, after: Fit) -> tuple[float, float, float]:
        """Of held-out errors relative to the largest stress of each test."""
        observed, peaks = self.protocol.observed, self.protocol.peaks
        first, second = (
            Prediction((observed - self._predictions(fit)[1]) / peaks, self._blocks, np.zeros(0))
            for fit in (before, after)
        )
        return second.improvement(first, self.protocol.mask(self.protocol.to_fit), self.random)

    def _confirm(self, fit: Fit, name: str) -> Confirmation | None:
        """Of one cause where all others of the fit act; None if no fit stands without it."""
        others = self.sets.fitted(fit.names - {name})
        if others is None:
            return None
        gained = self._predictions(fit)[2] - self._predictions(others)[2]
        p = placebo_p(self.sets.about(others), name, self.folds, self.random)
        evidence = [self.sets.by_names[names].hypothesis.log_evidence for names in (fit.names, others.names)]
        return Confirmation(name, evidence[0] - evidence[1], gained, self._improvement(others, fit), p)


def grown_errors(checked: CheckResults) -> tuple[list[str], list[str]]:
    """Errors that are larger with what was added than without, in words: of held-out tests, of tests never fitted."""
    if "explained" not in checked.scores:
        return [], []
    before, after = (checked.scores[name] for name in ("refitted", "explained"))
    first, second = before.heldout or 0.0, after.heldout or 0.0
    grown = [f"The error of held-out tests grows with it: from {first:.3g} Pa to {second:.3g} Pa."]
    checks = [
        f"'{name}', which was not fitted, is predicted worse with it: {before.check[name]:.3g} Pa without, "
        f"{after.check[name]:.3g} Pa with it."
        for name in before.check
        if after.check[name] > before.check[name]
    ]
    return grown if second > first else [], checks
