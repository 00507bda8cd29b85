"""What was left out of a specimen: sets of causes with probabilities, a verdict of least expected loss, its checks."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.estimation.options import Listener
from warpbrain.inference.calibration import calibration
from warpbrain.inference.causes import Kind
from warpbrain.inference.decide import NOTHING, UNKNOWN, Decision, after_checks, decide, if_significant
from warpbrain.physics.words import Measurement
from warpbrain.recordings.recording import TestRecording
from warpbrain.seconds import Seconds
from warpbrain.simulation.specimen import not_transmitted, specimen_of
from warpbrain.threads import one_thread_of_blas
from warpbrain.worlds.options import DiagnosisOptions
from warpbrain.worlds.specimen import result
from warpbrain.worlds.specimen.checks import Checker, grown_errors, score
from warpbrain.worlds.specimen.effects import effects_of
from warpbrain.worlds.specimen.fit import Fit, Forward, fit
from warpbrain.worlds.specimen.glued_ends import GluedEnds
from warpbrain.worlds.specimen.protocol import protocol_of
from warpbrain.worlds.specimen.search import CauseSet, Sets
from warpbrain.worlds.verdict import Combination, Ranked

#: Rows below which nothing is concluded; combinations that are told.
_FEWEST, _TOLD = 15, 12
#: Sets with their probabilities, the most probable first.
Ordered = Sequence[tuple[CauseSet, float]]


class DiagnosingSpecimen:
    """Diagnoses the tests of one case.

    `case`: with a specimen. `device`: of the finite elements that glued ends need. `InputError` if the case has no
    tests, too few rows for any conclusion, or assumes what a homogeneous state has not.
    """

    def __init__(
        self,
        case: Case,
        options: DiagnosisOptions | None = None,
        device: str | None = None,
        listener: Listener | None = None,
    ) -> None:
        self.case, self.device, self._listener = case, device, listener or Listener()
        self.options = options or DiagnosisOptions()
        self.seconds = Seconds()
        recordings = [recording for recording in case.recordings if isinstance(recording, TestRecording)]
        _check(case, recordings)
        #: All recorded rows.
        self.protocol = protocol_of(specimen_of(case), recordings)

    def run(self) -> result.SpecimenDiagnosis:
        """Every stage; `InputError` if the declared law finds no state in the tests."""
        with one_thread_of_blas():
            return self._run()

    def _run(self) -> result.SpecimenDiagnosis:
        options, protocol = self.options, self.protocol
        self._listener.stage("base: the case as declared, its tissue refitted")
        with self.seconds.of("base"):
            glued = specimen_of(self.case).grips == "glued" and options.ends
            forward = Forward(self.case, protocol.thinned, GluedEnds(self.case, protocol, self.device), glued)
            effects, rejected = effects_of(self.case, protocol.thinned, options.candidates)
            base = fit(forward, (), np.zeros(len(forward)))
        if base is None:
            raise InputError(f"{self.case.path}: the declared law finds no state in the tests")
        with self.seconds.of("sets of causes"):
            sets = Sets(effects, base, self._listener)
            ordered = sets.ordered()
        with self.seconds.of("checks"):
            checker = Checker(sets, protocol, options.draws, np.random.default_rng([options.seed, 11]), options.alpha)
            p_value = checker.p_left(base)
            chances = np.array([p for _, p in ordered])
            by_posterior, _ = decide([candidate.hypothesis for candidate, _ in ordered], chances, calibration().losses)
            claimed = if_significant(by_posterior, p_value, options.alpha)
            best = base if claimed.verdict == NOTHING else _explaining(ordered, claimed)
            checked = checker.of(best)
            decision, doubts = after_checks(
                claimed, checked.confirmations, checked.p_left, options.alpha, *grown_errors(checked)
            )
        names = decision.named
        with self.seconds.of("next measurement"):
            measurements = _next(ordered, base)
        with self.seconds.of("explained"):
            explained = _explained_case(best) if names else None
        declared = replace(forward, protocol=protocol).stress((), np.zeros(len(forward)))
        ranking = _ranking(sets, ordered, checker)
        ranked = {cause.kind: cause for cause in ranking}
        nothing = sets.nothing.hypothesis.log_evidence
        shows = None
        if best is not base:
            shows = result.where_it_shows(protocol, checked.stresses["refitted"], checked.stresses["explained"])
        return result.SpecimenDiagnosis(
            case=self.case,
            protocol=protocol,
            decision=decision,
            by_posterior=by_posterior,
            doubts=doubts,
            p_value=p_value,
            alpha=options.alpha,
            p_left=checked.p_left,
            named=tuple(replace(ranked[name], values=result.values_of(best, name)) for name in names),
            ranking=ranking,
            rejected=rejected,
            combinations=tuple(_combination(candidate, p, nothing) for candidate, p in ordered[:_TOLD]),
            where=shows,
            next_measurement=measurements,
            smallest=result.smallest_of(sets.about(base)),
            scores={"declared": score(protocol, declared)} | checked.scores,
            stresses={"declared": declared} | checked.stresses,
            improvement=checked.improvement,
            confirmations=checked.confirmations,
            explained=explained,
            assumptions=result.assumptions_of(best, protocol),
            remarks=tuple(
                f"{component.effect.name} is not simulated by a run: the explained case is fitted without it"
                for component in best.assumed
                if not component.effect.runs and component.effect.name != UNKNOWN
            ),
            seconds=self.seconds,
        )


def _check(case: Case, recordings: Sequence[TestRecording]) -> None:
    """Raise `InputError` if nothing can be said of tests."""
    rows = sum(len(recording.imposed) for recording in recordings if recording.role == "fit")
    if rows < _FEWEST:
        raise InputError(
            f"{case.path}: [[recording]] role = 'fit': {rows} rows of tests: too few for any conclusion; "
            f"{_FEWEST - rows} more would do"
        )
    for recording in recordings:
        who = f"{case.path}: [[recording]] '{recording.name}'"
        if why := not_transmitted(specimen_of(case).grips, recording.mode):
            raise InputError(f"{who} mode '{recording.mode}': {why}")
        if not np.abs(recording.response).any():
            raise InputError(f"{who} file '{recording.file}': every response is 0")


def _explaining(ordered: Ordered, decision: Decision) -> Fit:
    """The most probable fit that has all causes of a verdict; of one that speaks of none, of all with any."""
    wanted = {name for name in decision.named if name != UNKNOWN}
    fits = [candidate.fit for candidate, _ in ordered if candidate.fit is not None]
    explaining = (each for each in fits if each.names and wanted <= each.names)
    return next(explaining, next(each for each in fits if not each.names))


def _explained_case(best: Fit) -> Case | None:
    """The case with what was named, ready for `warpbrain run`: fitted again with nothing that a run cannot simulate.

    None if a run can simulate nothing of what is assumed, or no fit stands.
    """
    assumed, z = best.only(lambda effect: effect.runs)
    forward = replace(best.forward, shape_of_law=False)
    refitted = fit(forward, assumed, np.concatenate([np.zeros(len(forward)), z]), best.scale) if assumed else None
    if refitted is None:
        return None
    case = forward.case
    [(label, tissue)] = case.tissues.items()
    law = tissue.known_law.scaled_to(refitted.forward.modulus(refitted.z) * tissue.known_law.shear_modulus)
    return replace(
        case,
        name=f"{case.name}-explained",
        title=f"{case.title}, with {'-and-'.join(component.effect.name for component in assumed)}",
        tissues={label: replace(tissue, law=law)},
        mechanisms=(*case.mechanisms, *refitted.forward.mechanisms(assumed, refitted.z)),
    )


def _next(ordered: Ordered, base: Fit) -> tuple[Measurement, ...]:
    """What would tell the two most probable sets with mechanisms of a run apart, or the only one from none."""
    fits: dict[frozenset[str], Fit] = {}
    for candidate, _ in ordered:
        if candidate.fit is not None:
            runs = frozenset(each.effect.name for each in candidate.fit.assumed if each.effect.runs)
            fits.setdefault(runs, candidate.fit)
    first = [*(fitted for runs, fitted in fits.items() if runs), base]
    return result.next_measurements(*first[:2]) if len(first) > 1 else ()


def _combination(candidate: CauseSet, probability: float, nothing: float) -> Combination:
    """A set as it is told, with its evidence against that of nothing; what has no name comes last."""
    hypothesis = candidate.hypothesis
    each = sorted(zip(hypothesis.causes, hypothesis.kinds, strict=True), key=lambda cause: cause[0] == UNKNOWN)
    causes, kinds = tuple(name for name, _ in each), tuple(kind for _, kind in each)
    gain, fitted = hypothesis.log_evidence - nothing, candidate.fit is not None
    return Combination(causes, kinds, gain, hypothesis.log_prior, probability, fitted)


def _ranking(sets: Sets, ordered: Ordered, checker: Checker) -> tuple[Ranked, ...]:
    """Every cause alone, that which most probably acts first."""
    base, nothing = sets.base, sets.nothing.hypothesis.log_evidence
    ranked = []
    for effect in sets.effects:
        alone = sets.by_names.get(frozenset({effect.name}))
        change = d = None
        if alone is not None and alone.fit is not None:
            change = checker.heldout_rms(alone.fit) - checker.heldout_rms(base)
            moved = (alone.fit.stress - base.stress)[base.rows]
            d = float(np.linalg.norm(base.model.standardised(moved)))
        best = next((each.fit for each, _ in ordered if effect.name in each.names and each.fit is not None), None)
        values = () if best is None else result.values_of(best, effect.name)
        regions = () if best is None else (each.variant.region for each in best.assumed if each.effect is effect)
        gain = float("-inf") if alone is None else alone.hypothesis.log_evidence - nothing
        ranked.append(
            Ranked(
                effect.name,
                effect.kind is Kind.PHYSICS,
                gain,
                sum(p for candidate, p in ordered if effect.name in candidate.names),
                d,
                change,
                values,
                region=next(iter(regions), ""),
                rejected_because="" if np.isfinite(gain) else "no fit with it stands",
                sentence=effect.sentence_of(values),
            )
        )
    return tuple(sorted(ranked, key=lambda cause: (-cause.probability, -cause.log_evidence)))
