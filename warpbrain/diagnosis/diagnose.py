"""What was left out of a case: locate, name, model, show. One stage after the other."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.base import Base, BaseFinder
from warpbrain.diagnosis.between import between_neighbours
from warpbrain.diagnosis.checking import check_errors
from warpbrain.diagnosis.concluding import named_together
from warpbrain.diagnosis.evidence import Explanation, Stack
from warpbrain.diagnosis.held_out import Predicted
from warpbrain.diagnosis.judging import Judge, Judgement
from warpbrain.diagnosis.locating import ScoreMap, score_map
from warpbrain.diagnosis.measuring import next_measurements
from warpbrain.diagnosis.naming import named_in_turn
from warpbrain.diagnosis.onset import onset_of
from warpbrain.diagnosis.options import DiagnosisOptions
from warpbrain.diagnosis.placing import placed
from warpbrain.diagnosis.refining import refined
from warpbrain.diagnosis.refitting import Refit, Refitting
from warpbrain.diagnosis.result import (
    EXPLAINED,
    GROUP,
    NOT_PHYSICS,
    NOTHING,
    UNKNOWN,
    Confusion,
    Diagnosis,
    Fit,
    Ranked,
)
from warpbrain.diagnosis.screening import UNKNOWN as UNKNOWN_KIND
from warpbrain.diagnosis.sentences import assumptions_of, sentence_of
from warpbrain.diagnosis.sound_points import sound_points
from warpbrain.diagnosis.stage import WORTH, Stage, compared, linear_point
from warpbrain.diagnosis.traits import Traits, traits_of
from warpbrain.diagnosis.verdict import CLAIM, overall
from warpbrain.diagnosis.virtual import VirtualCases
from warpbrain.errors import InputError, SolveError
from warpbrain.threads import beside, in_threads, one_thread_of_blas
from warpbrain.worlds.body.dictionary import Candidates, candidates_at, candidates_beside, dictionary_of
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.not_physics import not_physics_at
from warpbrain.worlds.body.observable import require_observable
from warpbrain.worlds.body.parameters import SEEN, smallest_of
from warpbrain.worlds.body.states import States
from warpbrain.worlds.body.surfaces import with_sets_that_act
from warpbrain.worlds.body.values import Smallest
from warpbrain.worlds.listener import Listener

Floats = NDArray[np.float64]

#: Kinds that are refitted without linearising, at first and beside others, and the log Bayes factor behind the best at
#: which that ends.
_REFITTED, _REFITTED_BESIDE, _BEHIND = 3, 2, 12.0
#: By how much [nats] the fit of nothing may be better than what is linear about the base, until that is moved there.
_FAR = 3.0


@dataclass(frozen=True, eq=False)
class _Found:
    """What is named, stage by stage; where something is seen; and what the case would say of each mechanism."""

    stages: list[Stage]
    at_first: Judgement
    judged: list[Judgement]
    judge: Judge
    where: ScoreMap
    virtual: Callable[[], Confusion]

    @property
    def known(self) -> tuple[str, ...]:
        """Kinds that are named."""
        return self.stages[-1].known


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
        # enough that an alarm can be strong
        self._draws = max(self.options.draws, math.ceil(2.0 / (CLAIM * self.options.alpha)))

    def run(self) -> Diagnosis:
        """Every stage.

        Raises
        ------
        SolveError
            If the case as declared has no equilibrium.
        """
        with one_thread_of_blas():
            return self._run()

    def _run(self) -> Diagnosis:
        options = self.options
        rng = np.random.default_rng([options.seed, 7])
        spacing = self.dictionary.situation.spacing
        with self._timed("base"):
            finder = BaseFinder(self.states, spacing, options.mesh_error, options.without_nuisances, self.listener)
            base = finder.find()
        base, candidates = self._looked_for(base)
        first, refitting = self._first(base, candidates, rng)
        if first.beyond > _FAR:
            self.listener.stage("again about the fit of nothing, which is far from the first")
            with self._timed("base"):
                base = finder.moved(base, first.fits["none"].state, refitting.mesh_errors)
            base, candidates = self._looked_for(base)
            first, refitting = self._first(base, candidates, rng)
        if first.fits and (gross := first.gross_errors()).any():
            self.listener.stage("again without points that are gross errors")
            base = base.without(gross)
            first, refitting = self._first(base, candidates, rng)
        found = self._named(first, refitting, rng)
        sound = self._sound_beside(found.stages[-1])
        if sound.any():
            self.listener.stage("again with points that are no gross errors beside what is named")
            again = self._named(*self._first(base.with_back(sound), candidates, rng), rng)
            # for the sake of what is named only
            found = again if set(again.known) > set(found.known) else found
        self.listener.stage("virtual cases")
        with self._timed("virtual cases"):
            confusion = found.virtual()
        return self._conclude(found, confusion, rng)

    def _named(self, first: Stage, refitting: Refitting, rng: np.random.Generator) -> _Found:
        """What is named, one beside the other, and where something is seen."""
        options, base, spacing = self.options, first.base, self.dictionary.situation.spacing
        with self._timed("significance"):
            where = score_map(
                base.at, base.explanation, base.whitened, first.null, first.kappa, 0.7 * spacing, spacing, options.alpha
            )
        with self._timed("held out"):
            judge = Judge(base, options, rng)
            at_first = judge.judge(first)
        draws_of_cases = np.random.default_rng([options.seed, 11])
        virtual = beside(lambda: VirtualCases(first.screening, first.kappa, options.alpha, draws_of_cases).confusion())
        with self._timed("beside"):

            def next_stage(before: Stage, kind: str) -> tuple[Stage, Judgement] | None:
                fit = before.fits.get(kind) or self._refit(refitting, before, kind, None, before.fits.get("none"))
                if fit is None:
                    return None
                stage = self._beside(refitting, before, kind, fit, rng)
                return stage, judge.judge(stage)

            stages, judged = named_in_turn(first, at_first, next_stage)
        return _Found(stages, at_first, judged, judge, where, virtual)

    def _sound_beside(self, last: Stage) -> NDArray[np.bool_]:
        """Rows (n,) of points that are no gross errors beside what is named, if with them more is seen."""
        aside, groups = last.base.aside, last.base.at.sensors.groups
        nothing = np.zeros(len(aside), dtype=bool)
        with self._timed("beside"):
            each = [groups == group for group in np.unique(groups[aside])] if last.known else []
            if not any(in_threads(last.more_is_seen_with, each)):
                return nothing
            sound = sound_points(last.base, last.candidates, last.explanation, last.residual)
        return sound if last.more_is_seen_with(sound) else nothing

    def _first(self, base: Base, candidates: Candidates, rng: np.random.Generator) -> tuple[Stage, Refitting]:
        """What acts at all: screened, and refitted where something does."""
        self.listener.stage("screening")
        with self._timed("screening"):
            kappa = base.explanation.best_kappa(base.whitened)
            first = compared(base, (), candidates, base.explanation, base.residual, kappa, self._draws, rng)
        with self._timed("refit"):
            factor = base.explanation.factor
            refitting = Refitting(self.states, base.prior, base.nuisances, factor, base.state, base.mesh_errors)
            # where nothing is missing, nothing is to be fitted that would be
            alarmed = first.p_value <= self.options.alpha
            first.fits.update(self._refits(refitting, first, None, _REFITTED if alarmed else 0))
        return first, refitting

    def _looked_for(self, base: Base) -> tuple[Base, Candidates]:
        """What is looked for at a base, and that with the points that are no gross errors where something acts."""
        with self._timed("candidates"):
            alternatives = not_physics_at(base.at, base.nuisances)
            candidates = candidates_at(
                self.dictionary, base.effects, alternatives, lambda kind: self.listener.stage(f"candidate: {kind}")
            )
        with self._timed("screening"):
            return base.with_back(sound_points(base, candidates, base.explanation, base.residual)), candidates

    def _beside(self, refitting: Refitting, before: Stage, kind: str, fit: Refit, rng: np.random.Generator) -> Stage:
        """The next stage: what acts beside a kind, as it was refitted."""
        known = (*before.known, kind)
        self.listener.stage(f"what acts beside {' and '.join(known)}")
        candidates = candidates_beside(fit.state, fit.effects, before.candidates)
        explanation = fit.explanation(before.base.explanation.factor)
        stage = compared(before.base, known, candidates, explanation, fit.linear, fit.kappa, self._draws, rng)
        stage.fits["none"] = fit
        if stage.p_value <= self.options.alpha:
            stage.fits.update(self._refits(refitting, stage, fit, _REFITTED_BESIDE))
        return stage

    def _refits(self, refitting: Refitting, stage: Stage, known: Refit | None, most: int) -> dict[str, Refit]:
        """Fits without linearising: of the most probable kinds beside what is known, and of nothing at first."""
        kinds = stage.candidates.kinds
        factors = stage.screen.log_factors[: len(kinds), 0]
        order = np.argsort(-factors).tolist()
        least = factors[order[0]] - _BEHIND if known is None else max(factors[order[0]] - _BEHIND, WORTH)
        chosen = [kinds[k] for k in order[:most] if factors[k] > least]
        # to first order fluid and relaxing stress are too much alike: where one is refitted the other is
        in_time = [kinds[k] for k in order if factors[k] > least and stage.candidates.changes_in_time(kinds[k])]
        if not set(in_time).isdisjoint(chosen):
            chosen += [kind for kind in in_time if kind not in chosen]
        fits: dict[str, Refit] = {}
        for kind in chosen if known is not None else ["none", *chosen]:
            fit = self._refit(refitting, stage, kind, known, fits.get("none"))
            if fit is not None:
                fits[kind] = fit
        return fits

    def _refit(
        self, refitting: Refitting, stage: Stage, kind: str, known: Refit | None, none: Refit | None
    ) -> Refit | None:
        """Fit of one kind beside what is known, begun also at the fit of nothing; None if there is none to be had."""
        if kind != "none" and stage.best_effect(kind).proposal is None:
            return None
        self.listener.stage(f"refit without linearising: {' and '.join((*stage.known, kind))}")
        effect, between = (None, None) if kind == "none" else self._between_places(stage, kind)
        begin = linear_point(stage.explanation, stage.residual, stage.explanation.nuisances, effect, stage.kappa)
        begins = [begin]
        if known is None and none is not None:
            begins.append(linear_point(stage.explanation, none.linear, none.columns, effect, none.kappa))
        there = () if known is None else known.with_own_columns
        effects = there if effect is None else (*there, effect)
        if effect is not None and between is None:
            between = self._between(stage, kind, begin)
        try:
            return refitting.fit(effects, begins, stage.kappa, None if known is None else known.state, between)
        except (SolveError, InputError):
            return None

    @staticmethod
    def _between_places(stage: Stage, kind: str) -> tuple[Effect, Floats | None]:
        """The best effect of a kind between the places of its scan, and what the mesh leaves open of that, if known."""
        number = stage.screen.best_effect(stage.candidates, kind)
        effect = stage.candidates.effects[number]
        if effect.proposed.of_patch is None and effect.proposed.elsewhere is None:
            return effect, None
        found = placed(stage, number) if effect.proposed.of_patch is None else refined(stage, number)
        return found.effect, found.unresolved

    @staticmethod
    def _between(stage: Stage, kind: str, begin: Floats) -> Floats | None:
        number = stage.screen.best_effect(stage.candidates, kind)
        size = stage.candidates.effects[number].columns.shape[1]
        return between_neighbours(stage.candidates, kind, number, begin[len(begin) - size :])

    def _conclude(self, found: _Found, confusion: Confusion, rng: np.random.Generator) -> Diagnosis:
        stages, at_first, judged, judge, where = found.stages, found.at_first, found.judged, found.judge, found.where
        first = stages[0]
        base, candidates, fits = first.base, first.candidates, first.fits
        named = named_together(stages, judged)
        conclusion = overall([one.verdict for one in judged])
        held_out = {"none": at_first.without, **at_first.predicted}
        rest = conclusion.rest
        unknown = None
        if UNKNOWN in (conclusion.verdict, rest.verdict if rest is not None else ""):
            unknown = self._traits(stages[len(named)], where)
        group = conclusion.kinds if not named else rest.kinds if rest is not None and rest.verdict == GROUP else ()
        improvement = at_first.improvement
        if named:
            last = stages[len(named) - 1]
            fits = {**fits, EXPLAINED: last.fits[named[-1].kind]}
            held_out[EXPLAINED] = judge.predicted(fits[EXPLAINED], at_first.without)
            improvement = held_out[EXPLAINED].improvement(at_first.without, rng)
        when = None
        if conclusion.verdict not in (NOTHING, NOT_PHYSICS):
            most = at_first.ranking[0]
            when = onset_of(most.kind if most.physics else UNKNOWN_KIND, base, candidates, first.screen)
        fit = self._fit(base, fits, held_out, at_first, improvement, judged[0].placebo_p)
        smallest = self._smallest(base, candidates, first.screening.stack, first.kappa, confusion)
        physical = [r.kind for r in at_first.ranking if r.physics and r.kind in candidates.of_kind][:2]
        measurements = next_measurements(base, candidates, first.screen, physical, fits, first.kappa)
        return Diagnosis(
            self.case,
            conclusion.verdict,
            sentence_of(
                conclusion, named, at_first.ranking, first.p_value, smallest, fit, self.case.gravity_axis, unknown
            ),
            first.p_value,
            named,
            group,
            at_first.ranking,
            candidates.rejected,
            where,
            when,
            base,
            fits,
            held_out,
            self._explained(fits, named),
            smallest,
            confusion,
            measurements,
            fit,
            assumptions_of(self.case, base, first.kappa),
            base.remarks,
            self.seconds,
            unknown,
        )

    def _traits(self, stage: Stage, where: ScoreMap) -> Traits:
        """Of the force without a name that a stage leaves."""
        base, (linear, columns, kappa) = stage.base, stage.without
        explanation = Explanation(base.explanation.factor, columns)
        length = self.dictionary.situation.spacing
        return traits_of(base.at, explanation, linear, kappa, base.typical_noise, length, where.centre)

    def _explained(self, fits: dict[str, Refit], named: tuple[Ranked, ...]) -> Case | None:
        if not named:
            return None
        case = with_sets_that_act(self.states.case_of(fits[EXPLAINED].state.hypothesis), self.case.mesh)
        kinds = " and ".join(one.kind for one in named)
        return replace(case, name=f"{case.name}-explained", title=f"{case.title}, with {kinds}")

    def _fit(
        self,
        base: Base,
        fits: dict[str, Refit],
        held_out: dict[str, Predicted],
        judged: Judgement,
        improvement: tuple[float, float, float],
        placebo_p: float,
    ) -> Fit:
        rows = base.at.sensors.is_displacement & ~base.aside
        raw = float(np.sqrt(np.mean(base.declared.sensors.residual[rows] ** 2)))
        refitted = fits["none"].residual if "none" in fits else base.residual
        inside = float(np.sqrt(np.mean(refitted[rows] ** 2)))
        explained = gone = chance = None
        if EXPLAINED in fits:
            explained = (float(np.sqrt(np.mean(fits[EXPLAINED].residual[rows] ** 2))), held_out[EXPLAINED].rmse)
            gone, chance = improvement, placebo_p
        return Fit(
            (raw, raw),
            (inside, held_out["none"].rmse),
            explained,
            gone,
            chance,
            judged.placebo,
            judged.ceiling,
            check_errors(self.case, base, [fits[kind] for kind in ("none", EXPLAINED) if kind in fits]),
        )

    def _smallest(
        self, base: Base, candidates: Candidates, stack: Stack, kappa: float, confusion: Confusion
    ) -> dict[str, Smallest]:
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
            seen = confusion.needed(confusion.alarm, kind, 0.9)
            named = confusion.needed(confusion.named, kind, 0.5)
            # of what no plausible size makes so visible it is said how large it would have to be
            seen = seen if np.isfinite(seen) else SEEN
            found[kind] = smallest_of(candidates.effects[numbers[middle]], lengths[middle], seen, named)
        return found

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        begun = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begun
