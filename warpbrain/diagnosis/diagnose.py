"""What was left out of a case: sets of causes with probabilities, a verdict of least expected loss, its checks."""

from dataclasses import dataclass, replace

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.cases.shipped import as_case
from warpbrain.diagnosis.checking import Confirming, HeldOut, check_errors, distance
from warpbrain.diagnosis.locating import FittedSource, Traits, map_of_search, traits_of
from warpbrain.diagnosis.measuring import imitations, next_measurements, smallest
from warpbrain.diagnosis.onset import AS_IT_CHANGES, Onset, always_there, onset_of, size_over_time
from warpbrain.diagnosis.ranking import Ranking, about_base
from warpbrain.diagnosis.result import EXPLAINED, REFITTED, Diagnosis, Fit, assumptions_of
from warpbrain.errors import require_kind
from warpbrain.estimation.options import Listener
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import calibration
from warpbrain.inference.decide import (
    CANNOT_SAY,
    NAMED_AND_REST,
    NOT_PHYSICS,
    NOTHING,
    UNKNOWN,
    Confirmation,
    Decision,
    after_checks,
    decide,
    if_significant,
)
from warpbrain.inference.predict import Prediction
from warpbrain.physics.words import Measurement
from warpbrain.seconds import Seconds
from warpbrain.threads import beside, one_thread_of_blas
from warpbrain.worlds.body.causes import RESISTANCE
from warpbrain.worlds.body.hypotheses import HypothesisSearch, require_observable, screened
from warpbrain.worlds.body.surfaces import with_sets_that_act
from warpbrain.worlds.body.unknown import declarable
from warpbrain.worlds.body.weighted_set import WeightedSet
from warpbrain.worlds.options import DiagnosisOptions
from warpbrain.worlds.specimen.diagnose import DiagnosingSpecimen
from warpbrain.worlds.specimen.result import SpecimenDiagnosis
from warpbrain.worlds.verdict import Combination, Ranked

#: Sets of causes that a diagnosis lists.
_LISTED = 20
#: How often a verdict is checked, if its checks change what is probable.
_ROUNDS = 3
#: Why a cause was not weighed.
_INVISIBLE = "nothing that was recorded would tell of it, however large it were"


@dataclass(frozen=True, eq=False)
class _Checked:
    """A verdict after its checks, what failed in words, the set that it is about and the checks of that."""

    decision: Decision
    doubts: tuple[str, ...]
    best: WeightedSet
    confirmations: tuple[Confirmation, ...]
    p_left: float | None


class Diagnosing:
    """Diagnoses one case; `InputError` if the case has too few recordings for any conclusion, or is a specimen."""

    def __init__(
        self,
        case: Case,
        options: DiagnosisOptions | None = None,
        device: str | None = None,
        listener: Listener | None = None,
    ) -> None:
        self.case, self._device = case, device
        self.options = options or DiagnosisOptions()
        self.listener = listener or Listener()
        require_observable(case)
        self.seconds = Seconds()

    def run(self) -> Diagnosis:
        """Run every stage; `SolveError` if the case as declared has no equilibrium."""
        with one_thread_of_blas():
            diagnosis = self._run()
        diagnosis.search.release()
        return diagnosis

    def _run(self) -> Diagnosis:
        options = self.options
        random = np.random.default_rng([options.seed, 7])
        search = screened(
            self.case,
            self._device,
            self.listener,
            mesh_error=options.mesh_error,
            without_nuisances=options.without_nuisances,
            mechanisms=options.candidates,
            timed=self.seconds.of,
        )
        confirming = Confirming(search, options.draws, random, options.alpha)
        nothing = search.nothing
        with self.seconds.of("significance"):
            p_value = confirming.p_of_nothing(nothing)
        with self.seconds.of("fits"):
            # gross errors hide in the linear model what a fit at a better place lets through
            significant = p_value <= max(options.alpha, belief("fits.significance"))
            search.fit(alone=not significant and _decided(search).verdict == NOTHING)
        nothing = search.nothing
        with self.seconds.of("significance"):
            p_value = confirming.p_of_nothing(nothing)
        self.listener.stage("checks")
        with self.seconds.of("checks"):
            for _ in range(_ROUNDS):
                by_posterior = _decided(search)
                checked = self._checked(confirming, if_significant(by_posterior, p_value, options.alpha))
                # checks fit sets that the linear model had weighed alone: with other evidence of them the verdict of
                # least expected loss may be another one
                if _decided(search) == by_posterior:
                    break
            best, named = checked.best, checked.decision.named
            refitted = search.fitted_without_physics(best) if named else nothing
            weighted_sets = {REFITTED: refitted} | ({EXPLAINED: best} if named else {})
            source = search.fitted_source if checked.decision.verdict == UNKNOWN else None
            blocks = confirming.held_out_for(source or best)
            predictions = {name: confirming.predict(candidate, blocks) for name, candidate in weighted_sets.items()}
            fit = self._fit(confirming, weighted_sets, blocks, predictions, checked.confirmations)
            ranking = Ranking(confirming).all(best)
        confusing = beside(lambda: imitations(search.causes, nothing.marginal.model))
        with self.seconds.of("where"):
            where = map_of_search(search, options.draws, random, options.alpha)
            unknown, fitted_source = None, None
            if source is not None:
                error = blocks.error(confirming.predict(source, blocks))
                fitted_source = FittedSource.of(source, fit.refitted[1], error)
            if checked.decision.verdict in (UNKNOWN, NAMED_AND_REST):
                base, model = search.base, best.marginal.model
                traits = traits_of(base.at, model, best.residual, base.typical_noise, search.spacing, where.centre)
                resists = search.likely_unknown(best) == RESISTANCE
                unknown = replace(traits, resistance=resists, source=fitted_source)
        with self.seconds.of("what would be seen"):
            confusion = confusing()
            seen = smallest(search.causes, nothing.marginal.model, confusion)
        self.listener.stage("what to measure next")
        with self.seconds.of("next measurement"):
            measurements = _next(search, ranking)
        return Diagnosis(
            case=self.case,
            decision=checked.decision,
            by_posterior=by_posterior,
            doubts=checked.doubts,
            p_value=p_value,
            alpha=options.alpha,
            p_left=checked.p_left,
            named=tuple(next(cause for cause in ranking if cause.kind == name) for name in named),
            ranking=ranking,
            rejected=dict(search.candidates.rejected) | dict.fromkeys(search.invisible, _INVISIBLE),
            combinations=_combinations(search),
            map=where,
            when=_onset(search, checked.decision, best, unknown),
            search=search,
            weighted_sets=weighted_sets,
            held_out=predictions,
            explained=self._explained(search, best, named),
            smallest=seen,
            confusion=confusion,
            next_measurement=measurements,
            fit=fit,
            confirmations=checked.confirmations,
            assumptions=assumptions_of(self.case, search.base, best),
            remarks=search.base.remarks,
            seconds=self.seconds,
            unknown=unknown,
        )

    def _checked(self, confirming: Confirming, claimed: Decision) -> _Checked:
        """A significant verdict after its other checks, and the set that it is about."""
        search, alpha = confirming.search, self.options.alpha
        nothing = search.nothing
        if not claimed.named:
            return _Checked(claimed, (), nothing, (), None)
        best = search.fitted_with(frozenset(claimed.causes))
        if best is None:
            # no verdict on causes that cannot be simulated at the size that the data ask for
            failure = search.failure_with(frozenset(claimed.causes))
            doubt = f"{' and '.join(claimed.causes)}, as large as it is seen, could not be simulated: {failure}"
            return _Checked(Decision(CANNOT_SAY, claimed.causes), (doubt,), nothing, (), None)
        confirmations, p_left = confirming.confirmations(best), confirming.p_left(best)
        decision, doubts = after_checks(claimed, confirmations, p_left, alpha)
        if not decision.named:
            return _Checked(decision, doubts, nothing, confirmations, p_left)
        if set(decision.causes) != set(claimed.causes):
            best = search.fitted_with(frozenset(decision.causes), best)
            if best is None:
                # what the checks leave has no equilibrium
                return _Checked(Decision(CANNOT_SAY, claimed.causes), doubts, nothing, confirmations, p_left)
            p_left = confirming.p_left(best)
        return _Checked(decision, doubts, best, confirmations, p_left)

    def _explained(self, search: HypothesisSearch, best: WeightedSet, named: tuple[str, ...]) -> Case | None:
        if not named:
            return None
        assert best.refit is not None
        hypothesis = best.refit.state.hypothesis
        declared = replace(hypothesis, mechanisms=declarable(hypothesis.mechanisms))
        case = with_sets_that_act(search.base.states.case_of(declared), self.case.mesh)
        return replace(case, name=f"{case.name}-explained", title=f"{case.title}, with {' and '.join(named)}")

    def _fit(
        self,
        confirming: Confirming,
        weighted_sets: dict[str, WeightedSet],
        blocks: HeldOut,
        held_out: dict[str, Prediction],
        confirmations: tuple[Confirmation, ...],
    ) -> Fit:
        refitted, base = weighted_sets[REFITTED], confirming.search.base
        best = weighted_sets.get(EXPLAINED, refitted)
        sensors = base.at.sensors
        declared = distance(base.declared.sensors, base.declared.sensors.residual)
        errors = {
            name: (distance(sensors, candidate.best_residual), distance(sensors, held_out[name].errors))
            for name, candidate in weighted_sets.items()
        }
        patterns, improvement = (None, None) if best is refitted else confirming.improvement(refitted, best)
        refits = [candidate.refit for candidate in weighted_sets.values() if candidate.refit is not None]
        return Fit(
            (declared, declared),
            errors[REFITTED],
            errors.get(EXPLAINED),
            improvement,
            None if best is refitted else max(confirmation.placebo_p for confirmation in confirmations),
            patterns,
            confirming.ceiling(refitted, blocks),
            check_errors(self.case, base, refits),
        )


def diagnose(
    case: Case | str,
    options: DiagnosisOptions | None = None,
    device: str | None = None,
    listener: Listener | None = None,
) -> Diagnosis | SpecimenDiagnosis:
    """Say what a case leaves out.

    Parameters
    ----------
    case : Case or str
        A body, or a specimen with its tests; also the name of a shipped case, or the path of a case folder.
    options : DiagnosisOptions, optional
    device : str, optional
        ``"cpu"``, ``"cuda:0"``, ...; the GPU if there is one.
    listener : Listener, optional
        Told what is done.

    Returns
    -------
    Diagnosis or SpecimenDiagnosis
        What ``warpbrain diagnose`` writes its report from.

    Raises
    ------
    InputError
        If the case has too few recordings for any conclusion.
    SolveError
        If the case as declared has no equilibrium.
    """
    require_kind(options or DiagnosisOptions(), DiagnosisOptions, "options", "DiagnosisOptions(...)")
    case = as_case(case)
    if case.specimen is None:
        return Diagnosing(case, options, device, listener).run()
    return DiagnosingSpecimen(case, options, device, listener).run()


def _decided(search: HypothesisSearch) -> Decision:
    """The verdict of least expected loss."""
    hypotheses = [weighted_set.hypothesis for weighted_set in search.weighted_sets]
    return decide(hypotheses, search.probabilities, calibration().losses)[0]


def _combinations(search: HypothesisSearch) -> tuple[Combination, ...]:
    likely = zip(search.weighted_sets[:_LISTED], search.probabilities.tolist()[:_LISTED], strict=True)
    return tuple(
        Combination(
            weighted_set.hypothesis.causes,
            weighted_set.hypothesis.kinds,
            weighted_set.hypothesis.log_evidence,
            weighted_set.hypothesis.log_prior,
            probability,
            weighted_set.refit is not None,
            int(weighted_set.marginal.gross.sum()),
        )
        for weighted_set, probability in likely
    )


def _onset(search: HypothesisSearch, decision: Decision, best: WeightedSet, unknown: Traits | None) -> Onset | None:
    """Of the first cause that is named, or of an unknown force; None if nothing sets in."""
    if decision.verdict in (NOTHING, NOT_PHYSICS) or (not best.mechanisms and unknown and unknown.resistance):
        return None
    if not best.mechanisms:
        return onset_of(search.base, None, False, best.marginal.model, best.residual)
    name = best.mechanisms[0]
    number = best.acting.index(name)
    effect = best.effects[number]
    if (sizes := size_over_time(effect, *best.coefficients[number])) is not None:
        return Onset(0.0, sizes.seconds[-1], None, AS_IT_CHANGES, sizes=sizes)
    model, residual = about_base(search, best, name)
    cause = always_there(search.causes, name)
    return onset_of(search.base, cause, effect.proposed.changes_in_time, model, residual)


def _next(search: HypothesisSearch, ranked: tuple[Ranked, ...]) -> tuple[Measurement, ...]:
    """Measurements that discriminate between the two most probable mechanisms."""
    names = [cause.kind for cause in ranked if cause.physics][:2]
    if len(names) < 2:
        return ()
    sets = [next(s for s in search.weighted_sets if name in s.mechanisms) for name in names]
    return next_measurements(search.base, sets[0], sets[1], (names[0], names[1]))
