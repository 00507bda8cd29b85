"""One question of a diagnosis: what acts beside what is known already, compared at one state.

At first nothing is known and the state is the base; later it is that of the refit with all that was named, whose
columns are nuisances then, each with the width of its own prior.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.evidence import Explanation, log_mean
from warpbrain.diagnosis.gross_errors import ASIDE
from warpbrain.diagnosis.refitting import Refit
from warpbrain.diagnosis.screened import Screened
from warpbrain.diagnosis.screening import UNKNOWN, Screening
from warpbrain.diagnosis.single_points import gain_of_gross_errors, log_evidence_and_odds
from warpbrain.worlds.body.dictionary import Candidates
from warpbrain.worlds.body.effects import Effect

Floats = NDArray[np.float64]

#: Log Bayes factor that something needs to be looked at beside what is known.
WORTH = 2.0


@dataclass(frozen=True, eq=False)
class Stage(Screened):
    """What is compared.

    Attributes
    ----------
    known : tuple of str
        Kinds that are in all of the hypotheses.
    null : (n, b) array
        Whitened residuals in which nothing more is missing.
    alarms : (b,) array
        Log Bayes factor of anything more in each of these.
    fits : dict of str to Refit
        Without linearising: ``"none"`` with what is known, the others with their kind as the last effect.
    """

    known: tuple[str, ...]
    null: Floats
    alarms: Floats
    fits: dict[str, Refit]
    _compared: dict[tuple[Refit, ...], dict[str, float]] = field(default_factory=dict, init=False, repr=False)
    _known: dict[Refit, tuple[float, Floats]] = field(default_factory=dict, init=False, repr=False)
    _unknowns: dict[Refit, float] = field(default_factory=dict, init=False, repr=False)

    @property
    def p_value(self) -> float:
        """Of nothing more missing: by the screening, and by what was refitted if anything was, the larger of both.

        To first order an effect that is far from small may seem to explain what it does not. Refits come as near to the
        truth as nothing missing is to the linear model, which the null is drawn from.
        """
        alarms = [float(self.screen.alarm[0])]
        if not self.fits.keys() <= {"none"}:
            alarms.append(self.alarm)
        return float((1 + np.sum(self.alarms >= min(alarms))) / (1 + len(self.alarms)))

    @property
    def alarm(self) -> float:
        """Log Bayes factor of anything more against nothing more: the mean over kinds, refits included."""
        return float(log_mean(np.array(list(self.log_evidence().values()))))

    @property
    def without(self) -> tuple[Floats, Floats, float]:
        """The linear model (n,), (n, q) without anything more, and the factor on its noise."""
        if "none" in self.fits:
            none = self.fits["none"]
            return none.linear, none.columns, none.kappa
        return self.residual, self.explanation.nuisances, self.kappa

    @property
    def beyond(self) -> float:
        """How much better [nats] the fit without anything more is than what is linear about this state."""
        return self.fits["none"].log_evidence - float(self.screen.none[0]) if "none" in self.fits else 0.0

    def log_evidence(self) -> dict[str, float]:
        """Against nothing more: of refits where there are, else of screening, no better than a refit."""
        there = tuple(self.fits.values())
        if there not in self._compared:
            self._compared[there] = self._log_evidence()
        return self._compared[there]

    def _log_evidence(self) -> dict[str, float]:
        screen, fits = self.screen, self.fits
        screened = dict(zip(screen.kinds, screen.log_factors[:, 0].tolist(), strict=True))
        if "none" not in fits:
            return screened
        # a search that ended too early must not make everything else look better
        none = max(fits["none"].log_evidence, float(screen.none[0]))
        gross = self._gross(fits["none"])
        found: dict[str, float] = {}
        for kind, value in screened.items():
            if kind in fits:
                found[kind] = self._gain(kind, none) + self.over_places(kind) + self._gross(fits[kind]) - gross
            elif kind != UNKNOWN:
                found[kind] = value - (none - float(screen.none[0]))
                if kind in self.candidates.alternatives and found[kind] > 0.0:
                    found[kind] += self._gross_beside(kind) - gross
        best_screened = max((screened[kind] for kind in fits if kind != "none"), default=0.0)
        best_fitted = max((found[kind] for kind in fits if kind != "none"), default=0.0)
        # to first order only: what is not refitted is taken no better beside the best than screening had it
        for kind in found:
            if kind not in fits and self.best_effect(kind).proposal is not None:
                found[kind] = min(found[kind], best_fitted - (best_screened - screened[kind]))
        found[UNKNOWN] = self._unknown(fits["none"]) - none - gross
        return found

    def _gross(self, fit: Refit) -> float:
        """What a refit gains where single points may be gross errors."""
        return self._evidence_and_odds(fit)[0] - fit.log_evidence

    def _gross_beside(self, kind: str) -> float:
        """The same of the linear model with a kind that is not refitted."""
        explanation = self.explanation.with_more(self.best_effect(kind).columns)
        return gain_of_gross_errors(self.base.at.sensors, explanation, self.residual)

    def _gain(self, kind: str, none: float) -> float:
        """Log evidence of the refit of a kind less that without it; of what changes in time, of the change alone."""
        fit, lasting = self.fits[kind], self.best_effect(kind).lasting
        if lasting is None:
            return fit.log_evidence - none
        without = self.fits["none"]

        def beside_lasting(columns: Floats, linear: Floats) -> float:
            explanation = Explanation(self.explanation.factor, np.column_stack([columns, lasting]))
            return float(explanation.log_marginal(explanation.whitened(linear)[:, None])[0])

        # as above, no search that ended too early counts for the kind
        screened = beside_lasting(self.explanation.nuisances, self.residual)
        alike = max(beside_lasting(without.columns, without.linear), screened)
        return beside_lasting(fit.columns, fit.linear) - alike

    def more_is_seen_with(self, rows: NDArray[np.bool_]) -> bool:
        """Whether another kind than the known ones is best, and gains, with rows (n,) that are set aside.

        A known one does not count: beside a load nothing explains what moves as well as another such load, since nobody
        knows how the first is spread.
        """
        screening = self.screening.with_noise(rows, 1.0 / ASIDE)
        factors = screening.run(screening.explanation.whitened(self.residual)[:, None]).log_factors[:, 0]
        kinds = self.candidates.kinds
        best = int(np.argmax(factors[: len(kinds)]))
        return kinds[best] not in self.known and bool(factors[best] - self.screen.log_factors[best, 0] > WORTH)

    def gross_errors(self) -> NDArray[np.bool_]:
        """Rows (n,) of points that are rather gross errors than not, over all refits as they are probable."""
        from scipy.special import expit, softmax

        values = {**self.log_evidence(), "none": 0.0}
        weights = softmax([values[kind] for kind in self.fits])
        chances = [expit(self._evidence_and_odds(fit)[1]) for fit in self.fits.values()]
        return np.asarray(weights @ np.array(chances) > 0.5)

    def _evidence_and_odds(self, fit: Refit) -> tuple[float, Floats]:
        # which the evidence and the judge ask for in turn
        if fit not in self._known:
            explanation = fit.explanation(self.explanation.factor)
            self._known[fit] = log_evidence_and_odds(fit.state.sensors, explanation, fit.linear)
        return self._known[fit]

    def over_places(self, kind: str) -> float:
        """What the best of the places and levels of a kind loses where all of them are averaged over.

        Of a refit that has its place among its coefficients: of all places as many as it is averaged over already.
        """
        own = self.screen.places[self.candidates.of_kind[kind], 0]
        if kind in self.fits and (proposal := self.fits[kind].effects[-1].proposed).placing:
            return proposal.log_covered - float(np.log(len(own)))
        return float(log_mean(own)) - float(own.max())

    @property
    def best_pair(self) -> Floats:
        """What the most probable two places that draw each other (n, 1) do beside the fit without anything more."""
        linear, columns, _ = self.without
        explanation = Explanation(self.explanation.factor, columns)
        return self.base.pair_evidence(explanation).best(explanation.whitened(linear))

    def beside_unknown(self, kind: str) -> float:
        """Log evidence of the refit of a kind beside a force without a name, against that force without it."""
        return self._unknown(self.fits[kind]) + self.over_places(kind) - self._unknown(self.fits["none"])

    def _unknown(self, fit: Refit) -> float:
        """Log evidence of a force without a name beside a fit, where single points may be gross errors."""
        # as above
        if fit not in self._unknowns:
            self._unknowns[fit] = self._with_any_force(fit)
        return self._unknowns[fit]

    def _with_any_force(self, fit: Refit) -> float:
        explanation = fit.explanation(self.explanation.factor)
        forces = self.base.smooth_forces
        loose = [explanation.with_more(force) for force in forces]
        white = explanation.whitened(fit.linear)[:, None]
        plain = np.array([one.log_marginal(white)[0] for one in loose])
        pairs = self.base.pair_evidence(explanation)
        either = np.array([log_mean(plain), pairs.log_marginal(white)[0]])
        best = loose[int(np.argmax(plain))]
        if either[1] > either[0]:
            best = explanation.with_more(pairs.best(white[:, 0]))
        return float(log_mean(either)) + gain_of_gross_errors(fit.state.sensors, best, fit.linear)


def compared(
    base: Base,
    known: tuple[str, ...],
    candidates: Candidates,
    explanation: Explanation,
    residual: Floats,
    kappa: float,
    draws: int,
    rng: np.random.Generator,
) -> Stage:
    """A stage that has been screened; nothing is refitted yet."""
    screening = Screening(explanation, candidates, base.smooth_forces, pairs=base.pair_evidence(explanation))
    screen = screening.run(explanation.whitened(residual)[:, None])
    null = explanation.draws(draws, kappa, rng)
    alarms = screening.run(null).alarm
    return Stage(base, candidates, screening, residual, screen, kappa, known, null, alarms, {})


def linear_point(
    explanation: Explanation, residual: Floats, nuisances: Floats, effect: Effect | None, kappa: float
) -> Floats:
    """Coordinates of nuisances, and of an effect beside them, that the linear model has: to begin a refit with."""
    columns, mean = nuisances, np.zeros(len(residual))
    if effect is not None:
        columns, mean = np.column_stack([nuisances, effect.columns]), effect.mean
    W = explanation.whitened(columns) / kappa
    w = explanation.whitened(residual - mean) / kappa
    return np.asarray(np.linalg.solve(np.eye(W.shape[1]) + W.T @ W, W.T @ w))
