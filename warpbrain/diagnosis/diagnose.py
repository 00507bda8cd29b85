"""What was left out of a case: locate, name, model, show. One stage after the other."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.alternatives import alternatives_at
from warpbrain.diagnosis.base import Base, BaseFinder
from warpbrain.diagnosis.calibration import probabilities
from warpbrain.diagnosis.dictionary import Candidates, candidates_at, dictionary_of
from warpbrain.diagnosis.evidence import Inner, Stack
from warpbrain.diagnosis.flexible import SCALES
from warpbrain.diagnosis.held_out import HeldOut, Predicted, placebo, scattered_blocks, spatial_blocks
from warpbrain.diagnosis.locating import ScoreMap, ball_of, score_map
from warpbrain.diagnosis.measuring import next_measurements
from warpbrain.diagnosis.observable import require_observable
from warpbrain.diagnosis.options import DiagnosisOptions, Listener
from warpbrain.diagnosis.parameters import SEEN, scanned_values, smallest_of, values_of
from warpbrain.diagnosis.refitting import Refit, Refitting
from warpbrain.diagnosis.result import Diagnosis, Fit, Ranked, Smallest
from warpbrain.diagnosis.screening import UNKNOWN, Screen, Screening, log_unknown
from warpbrain.diagnosis.sentences import assumptions_of, sentence_of
from warpbrain.diagnosis.states import States
from warpbrain.diagnosis.verdict import ERRORS, Evidence, decide
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.observations import Observations

Floats = NDArray[np.float64]

#: Kinds that are refitted without linearising, and the log Bayes factor behind the best at which that ends.
_REFITTED, _BEHIND = 3, 12.0
#: How many patterns a mechanism that is scanned competes with, and one that is not.
_TRIES_SCANNED, _TRIES = 12, 2


class Diagnosing:
    """Diagnoses one case.

    Parameters
    ----------
    case : Case
    options : DiagnosisOptions, optional
    device : str, optional
    listener : Listener, optional

    Raises
    ------
    InputError
        If the case has too few recordings for any conclusion, or is a specimen.
    """

    def __init__(
        self,
        case: Case,
        options: DiagnosisOptions | None = None,
        device: str | None = None,
        listener: Listener | None = None,
    ) -> None:
        self.case = case
        self.options = options or DiagnosisOptions()
        self.listener = listener or Listener()
        require_observable(case)
        self.states = States(case, device)
        self.dictionary = dictionary_of(case, self.options.candidates, len(self.states.times))
        self.seconds: dict[str, float] = {}

    def run(self) -> Diagnosis:
        """Every stage.

        Raises
        ------
        SolveError
            If the case as declared has no equilibrium.
        """
        options = self.options
        rng = np.random.default_rng([options.seed, 7])
        spacing = self.dictionary.situation.spacing
        with self._timed("base"):
            finder = BaseFinder(self.states, spacing, options.mesh_error, options.without_nuisances, self.listener)
            base = finder.find()
        with self._timed("candidates"):
            candidates = self._candidates(base)
        self.listener.stage("screening")
        with self._timed("screening"):
            screening = Screening(base.explanation, candidates, base.smooth_forces)
            screen = screening.run(base.whitened[:, None])
        kappa = base.explanation.best_kappa(base.whitened)
        with self._timed("significance"):
            draws = base.explanation.draws(options.draws, kappa, rng)
            null = screening.run(draws).alarm
            p_value = float((1 + np.sum(null >= screen.alarm[0])) / (1 + len(null)))
            where = score_map(
                base.at, base.explanation, base.whitened, draws, kappa, 0.7 * spacing, spacing, options.alpha
            )
        with self._timed("refit"):
            fits = self._refits(base, candidates, screen, kappa)
        with self._timed("held out"):
            return self._conclude(base, candidates, screening, screen, fits, where, p_value, kappa, rng)

    def _candidates(self, base: Base) -> Candidates:
        alternatives = alternatives_at(base.at.sensors, base.nuisances)
        return candidates_at(
            self.dictionary, base.effects, alternatives, lambda kind: self.listener.stage(f"candidate: {kind}")
        )

    def _refits(self, base: Base, candidates: Candidates, screen: Screen, kappa: float) -> dict[str, Refit]:
        """Fits without linearising: of nothing, and of the most probable kinds."""
        refitting = Refitting(
            self.states, base.prior, base.nuisances, base.explanation.factor, base.state, base.difference
        )
        order = np.argsort(-screen.log_factors[: len(candidates.kinds), 0]).tolist()
        best = screen.log_factors[order[0], 0] if order else 0.0
        chosen = [candidates.kinds[k] for k in order[:_REFITTED] if best - screen.log_factors[k, 0] < _BEHIND]
        fits = {}
        for kind in ["none", *chosen]:
            self.listener.stage(f"refit without linearising: {kind}")
            effects = () if kind == "none" else (candidates.effects[screen.best_effect(candidates, kind)],)
            if any(effect.proposal is None for effect in effects):
                continue
            begin = _linear_point(base, candidates, screen, kind, kappa)
            try:
                fits[kind] = refitting.fit(effects, begin, kappa)
            except (SolveError, InputError):
                continue
        return fits

    def _conclude(
        self,
        base: Base,
        candidates: Candidates,
        screening: Screening,
        screen: Screen,
        fits: dict[str, Refit],
        where: ScoreMap,
        p_value: float,
        kappa: float,
        rng: np.random.Generator,
    ) -> Diagnosis:
        options = self.options
        sensors = base.at.sensors
        log_evidence = self._log_evidence(base, candidates, screen, fits)
        chances = probabilities(log_evidence, candidates.alternatives)
        regions = HeldOut(sensors, base.sigma, ~base.aside, spatial_blocks(sensors))
        scattered = HeldOut(sensors, base.sigma, ~base.aside, scattered_blocks(sensors))
        none = fits.get("none")
        linear, columns = (base.residual, base.nuisances.columns) if none is None else (none.linear, none.columns)
        ways = {kind: scattered if _is_local(fit) else regions for kind, fit in fits.items()}
        loud = kappa if none is None else none.kappa
        without = {way: way.predict(linear, columns, loud) for way in (regions, scattered)}
        predicted = {
            kind: ways[kind].predict(f.linear, f.columns, f.kappa) for kind, f in fits.items() if kind != "none"
        }
        beside = {kind: without[ways[kind]] for kind in fits}
        ranked = [
            self._ranked(kind, base, candidates, screen, fits, value, chances[kind], screening.stack, predicted, beside)
            for kind, value in log_evidence.items()
        ]
        ranking = tuple(sorted(ranked, key=lambda one: -one.probability))
        best = ranking[0].kind if ranking[0].kind in fits else next((r.kind for r in ranking if r.kind in fits), "none")
        gain, nats, sure = (0.0, 0.0, 0.0), 0.0, 0.0
        placebo_p, adequacy_p, size = 1.0, 1.0, 0.0
        band = None
        way = ways.get(best, regions)
        ceiling = self._ceiling(base, way, linear, columns, loud)
        if best != "none" and best in predicted:
            gain = predicted[best].improvement(without[way], rng)
            own = fits[best]
            both = [one.predict(own.linear, own.columns, own.kappa).gain(over) for one, over in without.items()]
            nats = predicted[best].gain(without[way])[0]
            sure = max(gained - ERRORS * error for gained, error in both)
            scanned = len(candidates.of_kind[best]) > 20
            freedom = fits[best].effects[0].columns.shape[1]
            patterns = placebo(
                way, linear, columns, base.flexible[-1], freedom,
                _TRIES_SCANNED if scanned else _TRIES, 4.0 * base.typical_noise, rng, loud,
            )  # fmt: skip
            band = (float(np.quantile(patterns, 0.05)), float(np.quantile(patterns, 0.95)))
            placebo_p = float((1 + np.sum(patterns <= predicted[best].rmse)) / (1 + len(patterns)))
            adequacy_p = self._adequacy(base, fits[best], rng)
            size = float(np.abs(fits[best].coefficients[0]).max())
        verdict = decide(Evidence(options.alpha, p_value, ranking, nats, sure, placebo_p, adequacy_p, size))
        named = tuple(r for r in ranking if r.kind in verdict.kinds) if "named" in verdict.verdict else ()
        explained = self._explained(fits, named)
        fit = self._fit(base, fits, without[way], predicted, named, gain, placebo_p, band, ceiling)
        smallest = self._smallest(base, candidates, screening.stack, kappa)
        physical = [r.kind for r in ranking if r.physics and r.kind in candidates.of_kind][:2]
        measurements = next_measurements(base, candidates, screen, physical, fits, kappa)
        return Diagnosis(
            self.case,
            verdict.verdict,
            sentence_of(verdict, ranking, p_value, smallest, fit, self.case.gravity_axis),
            p_value,
            named,
            verdict.kinds if not named else (),
            ranking,
            candidates.rejected,
            where,
            base,
            fits,
            {"none": without[way], **predicted},
            explained,
            smallest,
            {},
            measurements,
            fit,
            assumptions_of(self.case, base, kappa),
            base.remarks,
            self.seconds,
        )

    def _log_evidence(
        self, base: Base, candidates: Candidates, screen: Screen, fits: dict[str, Refit]
    ) -> dict[str, float]:
        """Against nothing missing: of refits where there are, else of screening, no better than a refit."""
        from scipy.special import logsumexp

        screened = dict(zip(screen.kinds, screen.log_factors[:, 0].tolist(), strict=True))
        if "none" not in fits:
            return screened
        # a search that ended too early must not make everything else look better
        none = max(fits["none"].log_evidence, float(screen.none[0]))
        found: dict[str, float] = {}
        for kind, value in screened.items():
            if kind in fits:
                own = screen.places[candidates.of_kind[kind], 0]
                # what was averaged over places and levels stays averaged
                over_places = float(logsumexp(own)) - np.log(len(own)) - float(own.max())
                found[kind] = fits[kind].log_evidence + over_places - none
            elif kind != UNKNOWN:
                found[kind] = value - (none - float(screen.none[0]))
        best_screened = max((screened[kind] for kind in fits if kind != "none"), default=0.0)
        best_fitted = max((found[kind] for kind in fits if kind != "none"), default=0.0)
        # to first order only: what is not refitted is taken no better beside the best than screening had it
        for kind in found:
            if kind not in fits and candidates.effects[candidates.of_kind[kind][0]].proposal is not None:
                found[kind] = min(found[kind], best_fitted - (best_screened - screened[kind]))
        found[UNKNOWN] = self._unknown(base, fits["none"]) - none
        return found

    def _unknown(self, base: Base, none: Refit) -> float:
        """Log evidence of any smooth force in the place of a mechanism."""
        explanation = none.explanation(base.explanation.factor)
        loose = [explanation.with_more(force) for force in base.smooth_forces]
        return float(log_unknown(loose, explanation.whitened(none.linear)[:, None])[0])

    def _ranked(
        self,
        kind: str,
        base: Base,
        candidates: Candidates,
        screen: Screen,
        fits: dict[str, Refit],
        log_evidence: float,
        chance: float,
        stack: Stack,
        predicted: dict[str, Predicted],
        without: dict[str, Predicted],
    ) -> Ranked:
        from scipy.special import softmax

        if kind == UNKNOWN:
            return Ranked(kind, False, log_evidence, chance, 0.0, None, (), None, None, "")
        number = screen.best_effect(candidates, kind)
        effect = candidates.effects[number]
        if effect.proposal is None:
            return Ranked(kind, False, log_evidence, chance, 0.0, None, (), None, None, "", "no physics")
        own = stack.of(number)
        if kind in fits:
            z, covariance, kappa = fits[kind].coefficients[0], fits[kind].covariances[0], fits[kind].kappa
        else:
            # where physics is missing, the noise that the base needs is no noise
            kappa = 1.0
            inner = Inner(base.explanation, stack, base.whitened[:, None])
            z, covariance = inner.coefficients(kappa, number)
        d = base.explanation.detectability(own[:, 0] + own[:, 1:] @ z, kappa)
        centre, radius = _place(candidates, screen, kind)
        change = predicted[kind].rmse - without[kind].rmse if kind in predicted else None
        why = "" if kind in fits else "less probable than what was refitted"
        own_places = candidates.of_kind[kind]
        scanned = [candidates.effects[k] for k in own_places.tolist()]
        weights = softmax(screen.places[own_places, 0])
        values = values_of(fits[kind].effects[0] if kind in fits else effect, z, covariance)
        values += tuple(v for v in scanned_values(scanned, weights) if v.name not in {known.name for known in values})
        return Ranked(kind, True, log_evidence, chance, d, change, values, centre, radius, effect.proposed.region, why)

    def _adequacy(self, base: Base, fit: Refit, rng: np.random.Generator) -> float:
        """Probability of what is left after a refit, if it is noise: any smooth force against none."""
        explanation = fit.explanation(base.explanation.factor)
        loose = [explanation.with_more(SCALES[0] * base.typical_noise * columns) for columns in base.flexible]

        def statistic(residuals: Floats) -> Floats:
            none = explanation.log_marginal(residuals)
            return np.asarray(np.max([one.log_marginal(residuals) - none for one in loose], axis=0))

        own = statistic(explanation.whitened(fit.linear)[:, None])[0]
        null = statistic(explanation.draws(self.options.draws, fit.kappa, rng))
        return float((1 + np.sum(null >= own)) / (1 + len(null)))

    def _ceiling(self, base: Base, held_out: HeldOut, linear: Floats, columns: Floats, kappa: float) -> float:
        """Held-out error with any smooth force of the size that suits best."""
        return min(
            held_out.predict(linear, np.column_stack([columns, force]), kappa).rmse for force in base.smooth_forces
        )

    def _explained(self, fits: dict[str, Refit], named: tuple[Ranked, ...]) -> Case | None:
        if not named:
            return None
        case = self.states.case_of(fits[named[0].kind].state.hypothesis)
        return replace(case, name=f"{case.name}-explained", title=f"{case.title}, with {named[0].kind}")

    def _fit(
        self,
        base: Base,
        fits: dict[str, Refit],
        without: Predicted,
        predicted: dict[str, Predicted],
        named: tuple[Ranked, ...],
        gain: tuple[float, float, float],
        placebo_p: float,
        band: tuple[float, float] | None,
        ceiling: float,
    ) -> Fit:
        rows = base.at.sensors.is_displacement & ~base.aside
        raw = float(np.sqrt(np.mean(base.declared.sensors.residual[rows] ** 2)))
        refitted = fits["none"].residual if "none" in fits else base.residual
        inside = float(np.sqrt(np.mean(refitted[rows] ** 2)))
        explained = improvement = chance = None
        if named:
            own = fits[named[0].kind]
            explained = (float(np.sqrt(np.mean(own.residual[rows] ** 2))), predicted[named[0].kind].rmse)
            improvement, chance = gain, placebo_p
        return Fit(
            (raw, raw),
            (inside, without.rmse),
            explained,
            improvement,
            chance,
            band,
            ceiling,
            self._check(base, fits, named),
        )

    def _check(self, base: Base, fits: dict[str, Refit], named: tuple[Ranked, ...]) -> tuple[float, ...] | None:
        """RMSE [m] at recordings with role `check`, which nothing above has seen."""
        checks = Observations.to_check(self.case)
        states = [base.declared]
        if "none" in fits:
            states.append(fits["none"].state)
        if named:
            states.append(fits[named[0].kind].state)
        found = []
        for state in states:
            parts = checks.at(state.u, state.reactions, base.states.centre)
            lengths = [p.values for p, one in zip(parts, checks.each, strict=True) if one.kind != "force"]
            if not lengths:
                return None
            found.append(float(np.sqrt(np.mean(np.concatenate([values.ravel() for values in lengths]) ** 2))))
        return tuple(found)

    def _smallest(self, base: Base, candidates: Candidates, stack: Stack, kappa: float) -> dict[str, Smallest]:
        """Of each kind, at the middle one of its places by how well the data see it."""
        found = {}
        for kind, numbers in candidates.of_kind.items():
            if candidates.effects[numbers[0]].proposal is None:
                continue
            lengths = []
            for number in numbers.tolist():
                effect = candidates.effects[number]
                switch = effect.proposed.is_there_or_not or effect.proposed.mean.any()
                lengths.append(base.explanation.detectability(stack.of(number)[:, 0 if switch else 1], kappa))
            middle = int(np.argsort(lengths)[len(lengths) // 2])
            found[kind] = smallest_of(candidates.effects[numbers[middle]], lengths[middle], SEEN)
        return found

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        begun = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begun


def _linear_point(base: Base, candidates: Candidates, screen: Screen, kind: str, kappa: float) -> Floats:
    """Coordinates of nuisances and mechanism that the linear model has, to begin a refit with."""
    columns, mean = base.nuisances.columns, np.zeros(len(base.residual))
    if kind != "none":
        effect = candidates.effects[screen.best_effect(candidates, kind)]
        columns, mean = np.column_stack([columns, effect.columns]), effect.mean
    explanation = base.explanation
    W = explanation.whitened(columns) / kappa
    w = explanation.whitened(base.residual - mean) / kappa
    return np.asarray(np.linalg.solve(np.eye(W.shape[1]) + W.T @ W, W.T @ w))


def _place(candidates: Candidates, screen: Screen, kind: str) -> tuple[Floats | None, float | None]:
    """Mean of the places where a kind may act, and the radius of a ball that holds 90 % of them."""
    from scipy.special import softmax

    own = candidates.of_kind[kind]
    best = candidates.effects[screen.best_effect(candidates, kind)].proposed
    if best.centre is None:
        return None, None
    located = [k for k in own.tolist() if candidates.effects[k].proposed.centre is not None]
    sites = np.array([candidates.effects[k].proposed.centre for k in located])
    centre, radius = ball_of(sites, softmax(screen.places[located, 0]))
    return centre, max(radius, float(best.radius or 0.0))


def _is_local(fit: Refit) -> bool:
    """Whether what was fitted acts in one place."""
    return any(effect.proposed.centre is not None for effect in fit.effects)
