"""The posterior over sets of causes of a body: screened in the linear model about the base, the best of them fitted.

The evidence of a set is the sum over places and sizes in the linear model. If the best of these is fitted, the
difference between the Laplace evidence of the fit and that of the linear model is added. Supersets of a fitted set are
weighed in the linear model about its fit, where what acts already is as large as it is.
"""

import itertools
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.cases.checking import too_few_to_diagnose
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.options import Listener
from warpbrain.estimation.parameters import Gaussian
from warpbrain.inference import GaussianModel, Kind, posterior
from warpbrain.inference.calibration import calibration
from warpbrain.inference.subsets import likely_places
from warpbrain.threads import in_threads, one_thread_of_blas
from warpbrain.worlds.body.base import Base, BaseFinder
from warpbrain.worlds.body.causes import UNKNOWN, causes_of, not_physics_at, unknown_effects, visible
from warpbrain.worlds.body.dictionary import (
    Candidates,
    candidates_about_fit,
    candidates_at,
    dictionary_of,
    with_releases_of,
)
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.evidence import SetMarginal, evidence_of, sizes_of
from warpbrain.worlds.body.fitting import CANNOT_BE_FITTED, Fitter
from warpbrain.worlds.body.moving import moved_about_fit
from warpbrain.worlds.body.nuisances import UNKNOWN_MESH
from warpbrain.worlds.body.parameters import log_overlap
from warpbrain.worlds.body.placing import with_refined_places
from warpbrain.worlds.body.states import SolvedState, States, instants_of
from warpbrain.worlds.body.stopping import bend_of, far_from_linear, next_to_fit
from warpbrain.worlds.body.weighing import Weighing, best_of_placements, keep_better, search_of
from warpbrain.worlds.body.weighted_set import Refit, WeightedSet

#: Places of each cause whose columns are made anew about a fit, and of releases for which states are solved.
_PLACES_ABOUT_FIT = _SOLVED = 8
#: How often at most a set is fitted, or its supersets are weighed, as long as any set may be chosen; and as often again
#: for the set that the verdict rests on, which may be another one after each fit. A limit of time: 32 of the
#: referee's 183 cases (runs 33 and 34) came to the end of 10, with sets left that a fit might have made the likeliest.
_MOST = 16
#: By how much [nats] another optimum is better that is worth a fit.
_BETTER = 1.0


class HypothesisSearch:
    """Weighs sets of causes. `spacing`: between the places of a scan [m]."""

    def __init__(self, base: Base, candidates: Candidates, spacing: float, listener: Listener) -> None:
        self.base, self.candidates, self.spacing, self._listener = base, candidates, spacing, listener
        self.causes = causes_of(base, candidates)
        self._visible = visible(self.causes, base.model)
        self._bend = bend_of(base)
        self._fitter = Fitter(base)
        self._sets: dict[frozenset[str], WeightedSet] = {}
        # of fitted sets whose supersets were weighed: what makes columns about the fit
        self._expanded: dict[frozenset[str], Effects] = {}
        # fitted sets about which nothing is linear
        self._unstable: set[frozenset[str]] = set()

    @property
    def weighted_sets(self) -> tuple[WeightedSet, ...]:
        """All that were weighed, the most probable first."""
        sets = list(self._sets.values())
        order = np.argsort(-_probabilities(sets), kind="stable")
        return tuple(sets[k] for k in order.tolist())

    @property
    def probabilities(self) -> Floats:
        """Of `weighted_sets`."""
        return _probabilities(self.weighted_sets)

    @property
    def log_bayes_factor(self) -> float:
        """Of anything that may act over nothing, summed over all weighted sets with their prior probabilities."""
        hypotheses = [candidate.hypothesis for candidate in self._sets.values()]
        something = [h.log_evidence + h.log_prior for h in hypotheses if h.causes]
        nothing = next(h.log_evidence for h in hypotheses if not h.causes)
        # prior odds that any of them acts
        odds = np.expm1(np.sum(np.log1p(np.exp([cause.log_prior for cause in self._visible.causes]))))
        return float(np.logaddexp.reduce(something) - np.log(odds) - nothing) if something else 0.0

    def get(self, names: Iterable[str]) -> WeightedSet | None:
        """A set by the names of its causes, if it was weighed."""
        return self._sets.get(frozenset(names))

    @property
    def invisible(self) -> tuple[str, ...]:
        """Causes that are in no set that was weighed, since nothing that was recorded would tell of them."""
        weighed = {name for names in self._sets for name in names}
        return tuple(cause.name for cause in self.causes.causes if cause.name not in weighed)

    @property
    def nothing(self) -> WeightedSet:
        """The set without any cause."""
        return self._sets[frozenset()]

    def screen(self) -> None:
        """Weigh sets about the base: with all points sound, and with those louder that are gross errors of no cause."""
        self._listener.stage("screening")
        base = self.base
        nothing = evidence_of(base, base.model.columns, base.residual, sizes_of(base))[1]
        models = [base.model]
        if nothing.gross.any():
            noise_factor = nothing.noise.noise_factor / nothing.scale
            models.append(GaussianModel(noise_factor, base.nuisances.columns))
        self.candidates = self._with_solved_releases(self.candidates, base.state, models[-1], base.residual)
        self.causes = causes_of(base, self.candidates)
        self._visible = visible(self.causes, base.model)
        weighing = Weighing(base, self._visible, nothing.sizes)
        for _, candidate in weighing.most_probable(models, most=2):
            keep_better(self._sets, candidate)
        # a local cause that has been missed by half a cell seems to do nothing
        singles = [candidate for candidate in self._sets.values() if len(candidate.acting) == len(candidate.names) == 1]
        refine = partial(with_refined_places, base, spacing=self.spacing, source=base.effects)
        for candidate in in_threads(refine, singles):
            self._sets[candidate.names] = candidate
        refined = [self._sets[single.names] for single in singles]
        for candidate in itertools.chain.from_iterable(in_threads(self._with_releases, refined)):
            keep_better(self._sets, candidate)

    def _with_solved_releases(
        self, candidates: Candidates, state: SolvedState, model: GaussianModel, residual: Floats
    ) -> Candidates:
        """The candidates with the effects of the most probable releases from equilibria with each.

        A patch that is released moves until the tissue around it balances what had held it. That is far from linear in
        the reaction, and patches that are as probable as each other to first order differ by tens of nats.

        `state`: about which the candidates are. `model`, `residual` (n,): of the rows without any further cause.
        """
        released = {kind for kind, of_kind in candidates.effects.items() if any(e.is_release for e in of_kind)}
        causes = [cause for cause in causes_of(self.base, candidates).causes if cause.name in released]
        if not causes:
            return candidates
        likely = likely_places(model, residual, causes, _SOLVED)
        solving, of_kinds = candidates.source.solving_releases(self.base.states, state), candidates.effects
        solved = {kind: with_releases_of(solving, of_kinds[kind], numbers.tolist()) for kind, numbers in likely.items()}
        return replace(candidates, effects={**of_kinds, **solved})

    def _with_releases(self, single: WeightedSet) -> list[WeightedSet]:
        """Sets of a release of held nodes beside a mechanism that is more probable than nothing.

        About the base the reactions that are released are those to the declared loads. What slides or lifts off under a
        load that is not declared moves nothing there: the reactions to that are added, to first order.
        """
        if single.hypothesis.log_evidence <= self.nothing.hypothesis.log_evidence:
            return []
        [effect], (mean, _) = single.effects, single.coefficients[0]
        beside = self.base.effects.beside(effect.constant_mechanisms(mean))
        of_all = self.candidates.effects.items()
        released = {kind: of_kind for kind, of_kind in of_all if any(each.is_release for each in of_kind)}
        if not beside.loading or not released.keys() - single.names:
            return []
        effects = {kind: with_releases_of(beside, of_kind) for kind, of_kind in released.items()}
        marginal = single.marginal
        causes = visible(causes_of(self.base, replace(self.candidates, effects=effects)), marginal.model)
        weighing = Weighing(self.base, causes, marginal.sizes, single)
        unscaled = GaussianModel(marginal.noise.noise_factor / marginal.scale, single.columns)
        return [replace(superset, inherited_gain=0.0) for superset in weighing.supersets([unscaled])]

    def fit(self, alone: bool = False) -> None:
        """Fit sets, and weigh supersets of those that are fitted, until no fit can be expected to change the verdict.

        `alone`: fit the set without any cause alone.
        """
        self._fit(frozenset())
        while not alone and (single := far_from_linear(list(self._sets.values()), self._bend)) is not None:
            self._fit(single.names)
        number = 0
        while number < (0 if alone else 2 * _MOST):
            expanded = {*self._expanded, *self._unstable}
            chosen = next_to_fit(self.weighted_sets, expanded, rivals=number < _MOST)
            if chosen is None:
                return
            if chosen.may_move:
                self._move(chosen)
                continue
            number += 1
            if chosen.refit is None:
                self._fit(chosen.names)
                continue
            try:
                self._weigh_supersets(chosen, chosen.refit)
            except SolveError:
                self._unstable.add(chosen.names)

    def fitted_with(self, mechanisms: frozenset[str], superset: WeightedSet | None = None) -> WeightedSet | None:
        """The most probable set with exactly these mechanisms, fitted; None if it cannot be.

        `superset`: a fitted set that has these and others, from whose optimum they are fitted if they were not weighed.
        """
        likely = next(iter(self._with_mechanisms(mechanisms)), None)
        if likely is not None and likely.refit is None:
            self._fit(likely.names)
            likely = self._sets[likely.names]
        if likely is not None and likely.refit is not None:
            return likely
        if superset is None:
            return None
        fitted = self._fitted_less(superset, [name for name in superset.mechanisms if name not in mechanisms])
        if fitted is not None:
            self._sets[fitted.names] = fitted
        return fitted

    def fitted_without_physics(self, weighted: WeightedSet) -> WeightedSet:
        """The causes of a weighted set that are no physics, fitted; nothing if there is none, or they cannot be."""
        names = frozenset(weighted.hypothesis.of_kind(Kind.NOT_PHYSICS))
        if names in self._sets and self._sets[names].refit is None:
            self._fit(names)
        fitted = self._sets.get(names, self.nothing)
        return self.nothing if fitted.refit is None else fitted

    @property
    def fitted_source(self) -> WeightedSet | None:
        """The most probable set with the unknown and no mechanism, if that is a source in one place and was fitted."""
        likely = next((s for s in self.weighted_sets if UNKNOWN in s.names and not s.mechanisms), None)
        return likely if likely is not None and likely.refit is not None and likely.has_placed(UNKNOWN) else None

    def likely_unknown(self, weighted: WeightedSet) -> str:
        """Label of the most probable place of the unknown in the residuals of a weighted set; see `Place.label`."""
        cause = self.causes.named(UNKNOWN)
        screened = posterior(weighted.marginal.model, weighted.residual, (cause,), search_of(most=1))
        [member] = next(hypothesis.best.members for hypothesis in screened if hypothesis.causes)
        return cause.places[member.place].label

    def failure_with(self, mechanisms: frozenset[str]) -> str:
        """Why the most probable set with exactly these mechanisms could not be fitted."""
        return next((candidate.failure for candidate in self._with_mechanisms(mechanisms) if candidate.failure), "")

    def _with_mechanisms(self, mechanisms: frozenset[str]) -> list[WeightedSet]:
        """Sets with exactly these mechanisms, the most probable first."""
        return [candidate for candidate in self.weighted_sets if frozenset(candidate.mechanisms) == mechanisms]

    def _fit(self, names: frozenset[str]) -> None:
        """Fit a set; one that cannot be fitted keeps the reason."""
        candidate = self._sets[names]
        self._listener.stage(f"fit without linearising: {' and '.join(sorted(names)) or 'nothing more'}")
        candidates = [candidate]
        if UNKNOWN in names:
            candidates = [replace(candidate, alternatives=()), *candidate.inheriting_alternatives]
        fits = [self._fitted(each) for each in candidates]
        fitted = best_of_placements(fits, candidates)
        self._sets[names] = fitted
        if fitted.refit is not None:
            gain = fitted.hypothesis.log_evidence - candidate.hypothesis.log_evidence
            self._pass_on((candidate.inherited_gain or 0.0) + gain, names)
            self._refit_subsets(names)

    def _fitted(self, candidate: WeightedSet) -> WeightedSet:
        """The set at its fit; if it cannot be fitted, the set with the reason (`failure`)."""
        subset = self._fitted_subset(candidate)
        if candidate.refit is None:
            source = self.base.effects if subset is None else self._expanded[subset.names]
            placed = 0 if subset is None else len(subset.effects)
            candidate = with_refined_places(self.base, candidate, self.spacing, source, placed)
        starts, nearby, screened = [candidate.coordinates], None, candidate.marginal
        if self.nothing.refit is not None and subset is None:
            coordinates, screened = self._about_nothing(self.nothing.refit, candidate)
            starts.append(coordinates)
            nearby = self.nothing.refit.state
        about = None if subset is None else subset.refit
        try:
            refit = self._fitter.fit(candidate.effects, candidate.columns, starts, screened, nearby, about)
        except CANNOT_BE_FITTED as error:
            return replace(candidate, failure=str(error))
        gain = refit.log_evidence - candidate.marginal.log_evidence
        if not candidate.names:
            # what the fit without any cause gains is of tissue and registration, and is gained by all others; a search
            # that ended too early must not make everything else look better
            gain = max(gain, 0.0)
        overlap = self._overlap(candidate, refit, 0 if subset is None else len(subset.effects))
        return candidate.fitted(refit).with_gain(gain - (candidate.inherited_gain or 0.0)).with_overlap(overlap)

    def _overlap(self, candidate: WeightedSet, refit: Refit, placed: int) -> float:
        """Sum of `log_overlap` of the effects of a fit but the first ones, which were `placed` with a fitted subset."""
        total, each = 0.0, zip(refit.effects, refit.coefficients, refit.covariances, candidate.acting, strict=True)
        for effect, z, covariance, name in itertools.islice(each, placed, None):
            others = [other.proposal for other in self.candidates.effects[name] if other.proposal is not None]
            alike = [p for p in others if p.make == effect.proposed.make and len(p) == len(effect.proposed)]
            if len(alike) > 1:
                total += log_overlap(effect, z, covariance, alike)
        return total

    def _move(self, fitted: WeightedSet) -> None:
        """Fit a fitted set and its alternatives where their mechanisms are better placed; the best of these is kept."""
        self._listener.stage(f"fit at better places: {' and '.join(sorted(fitted.names))}")
        known = [fitted, *fitted.inheriting_alternatives]
        fits = [fitted, *map(self._fitted, known[1:])]
        moved = best_of_placements(
            [
                moved_about_fit(self.base, self._fitter, fit, self.spacing) if fit.refit is not None else fit
                for fit in fits
            ],
            known,
        )
        self._sets[fitted.names] = moved = replace(moved, alternatives=())
        if moved.refit is not fitted.refit:
            self._forget_supersets(fitted.names)
            self._refit_subsets(fitted.names)

    def _refit_subsets(self, names: frozenset[str]) -> None:
        """Fit subsets with one mechanism less again, from the optimum of a set, if that is better than their own.

        The evidence has several local optima, with other points as gross errors, or the unknown as a source. A
        mechanism with no effect must not seem probable because the fit with it has reached a better one than the fit
        without it.
        """
        superset = self._sets[names]
        assert superset.refit is not None
        for cause in superset.acting if len(names) > 1 else ():
            subset = self._sets.get(names - {cause})
            if subset is None:
                continue
            reduced = superset.without(cause, self.base)
            if subset.refit is None and subset.acting == reduced.acting:
                continue
            # a field without a name that is not fitted, and may be a source, has that of the linear model
            known = subset.marginal.log_evidence if subset.refit is None else subset.refit.log_evidence
            # what neither search has come to counts for neither
            reached = reduced.marginal.log_evidence - superset.refit.unreached
            if reached < known + _BETTER:
                continue
            refitted = self._fitted_less(superset, [cause], known + _BETTER)
            if refitted is None or refitted.refit is None:
                continue
            gain = refitted.refit.log_evidence - known
            if gain > _BETTER:
                better = replace(refitted, hypothesis=subset.hypothesis, log_share=subset.log_share)
                self._sets[subset.names] = better.with_gain(gain)
                self._forget_supersets(subset.names)

    def _fitted_less(
        self, superset: WeightedSet, mechanisms: Sequence[str], wanted: float = -np.inf
    ) -> WeightedSet | None:
        """A set with some mechanisms less than a fitted one, fitted from its optimum; None if it cannot be.

        `wanted`: see `Fitter.fit`.
        """
        begun, reduced = superset.refit, superset
        assert begun is not None
        for mechanism in mechanisms:
            begun = begun.without(reduced.acting.index(mechanism), self.base)
            reduced = reduced.without(mechanism, self.base)
        screened = reduced.marginal
        try:
            refit = self._fitter.fit(
                reduced.effects, reduced.columns, [reduced.coordinates], screened, subset=begun, wanted=wanted
            )
        except CANNOT_BE_FITTED:
            return None
        gain = refit.log_evidence - screened.log_evidence
        log_prior = sum(self.causes.named(mechanism).log_prior for mechanism in mechanisms)
        hypothesis = replace(reduced.hypothesis, log_prior=reduced.hypothesis.log_prior - log_prior)
        fitted = replace(reduced.fitted(refit), hypothesis=hypothesis)
        return fitted.with_evidence(reduced.hypothesis.log_evidence + gain)

    def release(self) -> None:
        """Let go of factors and of the finer mesh, which no result needs: hundreds of megabytes at 5,000 nodes."""
        self._expanded.clear()
        self._fitter.finer.release()

    def _forget_supersets(self, names: frozenset[str]) -> None:
        """Remove supersets whose linear model is about an earlier fit of a set; expanding it again weighs them anew."""
        if self._expanded.pop(names, None) is not None:
            for other in list(self._sets.values()):
                if names < other.names and other.refit is None and other.inherited_gain is None:
                    del self._sets[other.names]

    def _pass_on(self, gain: float, names: frozenset[str]) -> None:
        """Give the gain of a fit to supersets that are not fitted, in the place of that of a fit of fewer causes."""
        for other in list(self._sets.values()):
            if names < other.names and other.refit is None and other.inherited_gain is not None:
                self._sets[other.names] = other.inheriting(gain)

    def _fitted_subset(self, candidate: WeightedSet) -> WeightedSet | None:
        """The fitted set whose fit the linear model of another is about; None if that is about the base."""
        if candidate.refit is not None:
            return None
        subsets = [self._sets[names] for names in self._expanded if names < candidate.names]
        same = [subset for subset in subsets if subset.effects == candidate.effects[: len(subset.effects)]]
        return max(same, key=lambda subset: len(subset.names), default=None)

    def _about_nothing(self, nothing: Refit, candidate: WeightedSet) -> tuple[Floats, SetMarginal]:
        """The most probable coordinates (q + e + k,) of a set in the linear model about the fit without any cause.

        And the evidence of the set, with its noise and gross errors, in that model or in the one about the base, in
        whichever it is larger. Far from the base sound points look like gross errors, and a fit that begins with these
        keeps them: the set would seem less probable only because it was weighed about the wrong state.
        """
        nuisances, base = self.base.nuisances, self.base
        columns = np.column_stack([nothing.columns, candidate.columns[:, len(nothing.nuisances) :]])
        residual = nothing.linear + candidate.residual - base.residual
        sizes, known = nothing.marginal.sizes, candidate.marginal
        _, marginal = evidence_of(base, columns, residual, sizes, nothing.marginal.scale)
        # the fit has the sizes of the columns that it begins with
        marginal = known if marginal.log_evidence < known.log_evidence else replace(marginal, sizes=known.sizes)
        columns = nuisances.with_family(UNKNOWN_MESH, columns, candidate.columns[:, nuisances.part(UNKNOWN_MESH)])
        of_field = nuisances.field_sizes.relative
        columns = nuisances.with_field(columns, of_field[known.sizes.field] / of_field[sizes.field])
        return GaussianModel(marginal.noise.noise_factor, columns).coefficients(residual)[0], marginal

    def _weigh_supersets(self, fitted: WeightedSet, refit: Refit) -> None:
        """Weigh every set of one cause more than a fitted one in the linear model about its fit."""
        self._listener.stage(f"what acts beside {' and '.join(sorted(fitted.names))}")
        marginal, noise_factors = fitted.marginal, [fitted.marginal.noise.noise_factor / fitted.marginal.scale]
        if marginal.gross.any():
            # what acts beside may be what moved them
            noise_factors.append(marginal.model.noise_factor)
        models = [GaussianModel(marginal.scale * factor, fitted.columns) for factor in noise_factors]
        places_of = partial(likely_places, residual=fitted.residual, causes=self.causes.causes, most=_PLACES_ABOUT_FIT)
        likely = in_threads(places_of, models)
        places = {name: np.unique([each[name] for each in likely]) for name in likely[0]}
        candidates = candidates_about_fit(refit.state, fitted.effects, self.candidates, places)
        self._expanded[fitted.names] = candidates.source
        if not any(effect.is_release for effect in fitted.effects):
            candidates = self._with_solved_releases(candidates, refit.state, models[0], fitted.residual)
        causes = causes_of(self.base, candidates)
        causes = replace(causes, causes=tuple(cause for cause in causes.causes if cause.name not in fitted.names))
        causes = visible(causes, marginal.model)
        best: dict[frozenset[str], WeightedSet] = {}
        weighing = Weighing(self.base, causes, marginal.sizes, fitted)
        unscaled = [GaussianModel(factor, fitted.columns) for factor in noise_factors]
        for superset in weighing.supersets(unscaled):
            keep_better(best, superset)
        fits = {names for names, known in self._sets.items() if known.refit is not None}
        placed = len(fitted.effects)
        refine = partial(with_refined_places, self.base, spacing=self.spacing, source=candidates.source, placed=placed)
        for superset in in_threads(refine, [superset for names, superset in best.items() if names not in fits]):
            self._sets[superset.names] = superset


def _probabilities(sets: Iterable[WeightedSet]) -> Floats:
    return calibration().probabilities([candidate.hypothesis for candidate in sets])


def require_observable(case: Case) -> None:
    """Raise `InputError` if there are too few recordings."""
    if case.specimen is not None:
        raise InputError(f"{case.path}: [specimen]: a specimen is diagnosed test by test")
    Observations.to_fit(case)
    if why := too_few_to_diagnose(case):
        raise InputError(f"{case.path}: {why}")


def screened(
    case: Case,
    device: str | None = None,
    listener: Listener | None = None,
    prior: Gaussian | None = None,
    *,
    mesh_error: bool = True,
    without_nuisances: bool = False,
    mechanisms: Sequence[str] | None = None,
    timed: Callable[[str], AbstractContextManager[Any]] = nullcontext,
) -> HypothesisSearch:
    """Sets of causes of a case.

    `prior`: of the tissues' parameters; that of a diagnosis unless given.
    `mesh_error`: False takes the mesh for exact.
    `without_nuisances`: whether mechanisms are credited with what is no physics, too.
    `mechanisms`: kinds that are looked for; all by default.
    `timed`: a context in which each stage is done, by its name.

    `InputError` if there are too few recordings, or they tell of no force. `SolveError` if the case as declared has no
    equilibrium.
    """
    require_observable(case)
    listener = listener or Listener()
    states = States(case, device)
    dictionary = dictionary_of(case, mechanisms, instants_of(case, states.times), states.times)
    spacing = dictionary.situation.spacing
    with one_thread_of_blas():
        with timed("base"):
            base = BaseFinder(states, spacing, mesh_error, without_nuisances, listener, prior).find()
        sensors = base.at.sensors
        if not (sensors.by_displacement[:, base.at.free].count_nonzero() or sensors.by_reactions.count_nonzero()):
            raise InputError(f"{case.path}: [[recording]]: no force moves what was recorded: the body is held there")
        with timed("candidates"):
            candidates = candidates_at(
                dictionary,
                base.effects,
                not_physics_at(base.at, base.nuisances),
                lambda kind: listener.stage(f"candidate: {kind}"),
            ).with_effects(UNKNOWN, unknown_effects(base))
        search = HypothesisSearch(base, candidates, spacing, listener)
        with timed("screening"):
            search.screen()
    return search
