"""Whether the best answer of a stage is a name: what held-out points, placebos and what is left say of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.averaging import averaged_values
from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.calibration import BODIES, probabilities
from warpbrain.diagnosis.evidence import Explanation
from warpbrain.diagnosis.flexible import SCALES
from warpbrain.diagnosis.held_out import HeldOut, Predicted, placebo, scattered_blocks, spatial_blocks
from warpbrain.diagnosis.letting_go import where_it_lets_go
from warpbrain.diagnosis.locating import ball_of
from warpbrain.diagnosis.options import DiagnosisOptions
from warpbrain.diagnosis.refitting import Refit
from warpbrain.diagnosis.result import Ranked
from warpbrain.diagnosis.screening import UNKNOWN
from warpbrain.diagnosis.stage import Stage
from warpbrain.diagnosis.verdict import ADEQUATE, Evidence, Verdict, decide
from warpbrain.worlds.body.parameters import scanned_values, values_of

Floats = NDArray[np.float64]

#: How many patterns a mechanism that is scanned competes with, and one that is not; and how many places are a scan.
_TRIES_SCANNED, _TRIES, _SCANNED = 12, 2, 20


@dataclass(frozen=True, eq=False)
class Judgement:
    """What a stage comes to.

    Attributes
    ----------
    verdict : Verdict
    ranking : tuple of Ranked
    without : Predicted
        What held-out points are predicted to be without anything more.
    predicted : dict of str to Predicted
        And with each kind that was refitted.
    improvement : (part, low, high)
        Of the held-out error that the best kind takes away, with its 95 % interval.
    placebo_p : float
    placebo : (low, high) or None
        Held-out errors of nine of ten patterns that mean nothing.
    ceiling : float
        Held-out error with any smooth force.
    """

    verdict: Verdict
    ranking: tuple[Ranked, ...]
    without: Predicted
    predicted: dict[str, Predicted]
    improvement: tuple[float, float, float]
    placebo_p: float
    placebo: tuple[float, float] | None
    ceiling: float


class Judge:
    """Judges the stages of one case.

    Parameters
    ----------
    base : Base
    options : DiagnosisOptions
    rng : Generator
    """

    def __init__(self, base: Base, options: DiagnosisOptions, rng: np.random.Generator) -> None:
        sensors = base.at.sensors
        self.base, self.options, self._rng = base, options, rng
        self._regions = HeldOut(sensors, base.sigma, ~base.aside, spatial_blocks(sensors))
        self._scattered = HeldOut(sensors, base.sigma, ~base.aside, scattered_blocks(sensors))

    def judge(self, stage: Stage) -> Judgement:
        """Every test of a stage, and the rule."""
        log_evidence = stage.log_evidence()
        chances = probabilities(log_evidence, stage.candidates.alternatives)
        plain = stage.without
        without = {way: way.predict(*plain) for way in (self._regions, self._scattered)}
        fits = {kind: fit for kind, fit in stage.fits.items() if kind != "none"}
        ways = {kind: self._scattered if _is_local(fit) else self._regions for kind, fit in fits.items()}
        predicted = {kind: ways[kind].predict(fit.linear, fit.columns, fit.kappa) for kind, fit in fits.items()}
        ranked = []
        for kind, value in log_evidence.items():
            change = predicted[kind].rmse - without[ways[kind]].rmse if kind in fits else None
            ranked.append(self._ranked(stage, kind, value, chances[kind], change))
        ranking = tuple(sorted(ranked, key=lambda one: -one.probability))
        best = next((one.kind for one in ranking if one.kind in fits), None)
        improvement, gain, sure, placebo_p, adequacy_p, size = (0.0, 0.0, 0.0), 0.0, 0.0, 1.0, 1.0, 0.0
        needed, band = 1.0, None
        way = self._regions if best is None else ways[best]
        if best is not None:
            own = fits[best]
            improvement = predicted[best].improvement(without[way], self._rng)
            [other] = [one for one in without if one is not way]
            elsewise = other.predict(own.linear, own.columns, own.kappa)
            gain, sure = predicted[best].gain(without[way])
            sure = max(sure, elsewise.gain(without[other])[1])
            patterns = self._placebo(stage, way, best)
            errors = [one.rmse for one in patterns]
            band = (float(np.quantile(errors, 0.05)), float(np.quantile(errors, 0.95)))
            # with the same noise as they have
            dense = way.predict(own.linear, own.columns, plain[2]).log_density
            placebo_p = float((1 + sum(one.log_density >= dense for one in patterns)) / (1 + len(patterns)))
            adequacy_p = self._adequacy(own)
            needed = _acts(log_evidence[best])
            if adequacy_p <= ADEQUATE:
                needed = min(needed, _acts(stage.beside_unknown(best)))
            size = float(np.abs(own.coefficients[-1]).max())
        forces = [np.column_stack([plain[1], force]) for force in self.base.smooth_forces]
        loose = {one: [one.predict(plain[0], columns, plain[2]) for columns in forces] for one in without}
        drawn = np.column_stack([plain[1], stage.best_pair])
        nameless = {one: [*each, one.predict(plain[0], drawn, plain[2])] for one, each in loose.items()}
        unknown_sure = max(predicted.gain(without[one])[1] for one, each in nameless.items() for predicted in each)
        groups = self.base.at.sensors.groups
        set_aside = len(np.unique(groups[self.base.aside]))
        evidence = Evidence(
            self.options.alpha,
            stage.p_value,
            min(stage.p_value, float(np.exp(-stage.alarm / BODIES.temperature))),
            ranking,
            gain,
            sure,
            placebo_p,
            adequacy_p,
            needed,
            size,
            unknown_sure,
            set_aside / len(np.unique(groups)),
            set_aside,
        )
        return Judgement(
            decide(evidence),
            ranking,
            without[way],
            predicted,
            improvement,
            placebo_p,
            band,
            min(one.rmse for one in loose[way]),
        )

    def predicted(self, fit: Refit, beside: Predicted) -> Predicted:
        """What a fit predicts of the blocks that another one was asked for."""
        same = np.array_equal(beside.blocks, self._regions.blocks[beside.rows])
        return (self._regions if same else self._scattered).predict(fit.linear, fit.columns, fit.kappa)

    def _placebo(self, stage: Stage, way: HeldOut, kind: str) -> list[Predicted]:
        linear, columns, kappa = stage.without
        tries = _TRIES_SCANNED if len(stage.candidates.of_kind[kind]) > _SCANNED else _TRIES
        freedom = stage.fits[kind].effects[-1].columns.shape[1]
        size = 4.0 * self.base.typical_noise
        return placebo(way, linear, columns, self.base.flexible[-1], freedom, tries, size, self._rng, kappa)

    def _ranked(self, stage: Stage, kind: str, log_evidence: float, chance: float, change: float | None) -> Ranked:
        from scipy.special import softmax

        if kind == UNKNOWN:
            return Ranked(kind, False, log_evidence, chance, 0.0, None, (), None, None, "")
        candidates, screen, explanation = stage.candidates, stage.screen, stage.explanation
        number = screen.best_effect(candidates, kind)
        effect = candidates.effects[number]
        if effect.proposal is None:
            return Ranked(kind, False, log_evidence, chance, 0.0, None, (), None, None, "", "no physics")
        fit = stage.fits.get(kind)
        if fit is not None:
            z, covariance, kappa = fit.coefficients[-1], fit.covariances[-1], fit.kappa
            d = _detectability(stage, fit)
        else:
            # where physics is missing, the noise that the stage needs is no noise
            kappa = 1.0
            whitened = explanation.whitened(stage.residual)
            z, covariance = stage.screening.of_effects.coefficients(whitened, kappa, number)
            own = stage.screening.stack.of(number)
            d = explanation.detectability(own[:, 0] + own[:, 1:] @ z, kappa)
        if fit is None:
            (centre, radius), values = _place(stage, kind), values_of(effect, z, covariance)
        elif effect.proposed.of_patch is not None:
            where = where_it_lets_go(stage, kind)
            centre, radius, values = where.centre, where.radius, where.values
        else:
            centre, radius = _place_of(fit) or _place(stage, kind)
            values = averaged_values(stage, kind, fit, len(fit.effects) - 1)
        why = "less probable than what was refitted" if stage.p_value <= self.options.alpha else "nothing is missing"
        why = "" if fit is not None else why
        own_places = candidates.of_kind[kind]
        scanned = [candidates.effects[k] for k in own_places.tolist()]
        weights = softmax(screen.places[own_places, 0])
        values += tuple(v for v in scanned_values(scanned, weights) if v.name not in {known.name for known in values})
        return Ranked(kind, True, log_evidence, chance, d, change, values, centre, radius, effect.proposed.region, why)

    def _adequacy(self, fit: Refit) -> float:
        """Probability of what is left after a refit, if it is noise: any smooth force against none."""
        base = self.base
        explanation = fit.explanation(base.explanation.factor)
        loose = [explanation.with_more(SCALES[0] * base.typical_noise * columns) for columns in base.flexible]

        def statistic(residuals: Floats) -> Floats:
            none = explanation.log_marginal(residuals)
            return np.asarray(np.max([one.log_marginal(residuals) - none for one in loose], axis=0))

        own = statistic(explanation.whitened(fit.linear)[:, None])[0]
        null = statistic(explanation.draws(self.options.draws, fit.kappa, self._rng))
        return float((1 + np.sum(null >= own)) / (1 + len(null)))


def _acts(log_evidence: float) -> float:
    """Probability of what has this log evidence against the same without it."""
    return probabilities({"with": log_evidence, "without": 0.0}, frozenset())["with"]


def _detectability(stage: Stage, fit: Refit) -> float:
    """Of what was added last beside what acts without it: from nothing to the best point by the trapezium rule."""
    effect, z = fit.effects[-1], fit.coefficients[-1]
    own = fit.with_own_columns[-1].columns
    # what is there or not, or takes its time, is solved as a whole: it has no line from nothing to where it is
    whole = effect.proposed.is_there_or_not or effect.proposed.changes_in_time
    change = effect.mean + effect.columns @ z if whole else 0.5 * (effect.columns + own) @ effect.away(z)
    # at the best point tissue explains how large it is, which says nothing of whether it is seen
    without = Explanation(stage.explanation.factor, stage.without[1])
    return without.detectability(without.whitened(change), fit.kappa)


def _place(stage: Stage, kind: str) -> tuple[Floats | None, float | None]:
    """Mean of the places where a kind may act, and the radius of a ball that holds 90 % of them."""
    from scipy.special import softmax

    effects, own = stage.candidates.effects, stage.candidates.of_kind[kind]
    best = stage.best_effect(kind).proposed
    if best.centre is None:
        return None, None
    located = [k for k in own.tolist() if effects[k].proposed.centre is not None]
    sites = np.array([effects[k].proposed.centre for k in located])
    centre, radius = ball_of(sites, softmax(stage.screen.places[located, 0]))
    return centre, max(radius, float(best.radius or 0.0))


def _place_of(fit: Refit) -> tuple[Floats, float] | None:
    """Centre and radius of what was added last, where the fit has them."""
    effect = fit.effects[-1]
    place = effect.proposed.place
    return None if place is None else place(effect.coefficients(fit.coefficients[-1]))


def _is_local(fit: Refit) -> bool:
    """Whether what was added last acts in one place."""
    return fit.effects[-1].proposed.centre is not None
