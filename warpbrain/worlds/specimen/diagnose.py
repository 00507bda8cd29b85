"""What was left out of a specimen: sets of causes with probabilities, a verdict of least expected loss, its checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.inference.calibration import calibration
from warpbrain.inference.causes import Kind
from warpbrain.inference.confirm import after_checks
from warpbrain.inference.decide import NAMED, NAMED_AND_REST, NOTHING, UNKNOWN, Decision, decide
from warpbrain.physics.values import Measurement, Value
from warpbrain.recordings.recording import TestRecording
from warpbrain.seconds import Seconds
from warpbrain.simulation.specimen import not_transmitted, specimen_of
from warpbrain.threads import one_thread_of_blas
from warpbrain.worlds.listener import Listener
from warpbrain.worlds.specimen.actions import Effect
from warpbrain.worlds.specimen.checking import Checker, grown_errors
from warpbrain.worlds.specimen.effects import effects_of
from warpbrain.worlds.specimen.explained import explained_case
from warpbrain.worlds.specimen.fit import Fit, Fitting
from warpbrain.worlds.specimen.forward import Forward
from warpbrain.worlds.specimen.glued_ends import GluedEnds
from warpbrain.worlds.specimen.measures import score, smallest_of, values_of, where_it_shows
from warpbrain.worlds.specimen.next_tests import next_measurements
from warpbrain.worlds.specimen.noise import noise_factor
from warpbrain.worlds.specimen.protocol import protocol_of
from warpbrain.worlds.specimen.result import Combination, Ranked, SpecimenDiagnosis
from warpbrain.worlds.specimen.search import CauseSet, Sets
from warpbrain.worlds.specimen.sentences import assumptions_of

#: Rows below which nothing is concluded; combinations that are told.
_FEWEST, _TOLD = 15, 12


@dataclass(frozen=True)
class SpecimenOptions:
    """What is asked for.

    Parameters
    ----------
    candidates : tuple of str or None
        Causes to look for; None: all.
    alpha : float
        Probability of an alarm where nothing is missing, and below which a check fails.
    seed : int
        Of all draws.
    draws : int
        Of rows in which nothing is missing.
    ends : bool
        Whether glued ends are computed; otherwise states are taken for homogeneous, as test evaluations do.
    """

    candidates: tuple[str, ...] | None = None
    alpha: float = 0.05
    seed: int = 0
    draws: int = 400
    ends: bool = True


class DiagnosingSpecimen:
    """Diagnoses the tests of one case.

    Parameters
    ----------
    case : Case
        With a specimen.
    options : SpecimenOptions, optional
    device : str, optional
        Of the finite elements that glued ends need.
    listener : Listener, optional

    Raises
    ------
    InputError
        If the case has no tests, too few rows for any conclusion, or assumes what a homogeneous state has not.
    """

    def __init__(
        self,
        case: Case,
        options: SpecimenOptions | None = None,
        device: str | None = None,
        listener: Listener | None = None,
    ) -> None:
        self.case, self.device, self._listener = case, device, listener or Listener()
        self.options = options or SpecimenOptions()
        self.seconds = Seconds()
        recordings = [one for one in case.recordings if isinstance(one, TestRecording)]
        self._check(recordings)
        #: All recorded rows, and those that densities are of.
        self.protocol = protocol_of(specimen_of(case), recordings)
        self.thinned = self.protocol.thinned

    def _check(self, recordings: Sequence[TestRecording]) -> None:
        specimen, path = specimen_of(self.case), self.case.path
        rows = sum(len(one.imposed) for one in recordings if one.role == "fit")
        if rows < _FEWEST:
            raise InputError(
                f"{path}: [[recording]] role = 'fit': {rows} rows of tests: too few for any conclusion; "
                f"{_FEWEST - rows} more would do"
            )
        for one in recordings:
            who = f"{path}: [[recording]] '{one.name}'"
            if why := not_transmitted(specimen.grips, one.mode):
                raise InputError(f"{who} mode '{one.mode}': {why}")
            if not np.abs(one.response).any():
                raise InputError(f"{who} file '{one.file}': every response is 0")

    def run(self) -> SpecimenDiagnosis:
        """Every stage.

        Raises
        ------
        InputError
            If the declared law finds no state in the tests.
        """
        with one_thread_of_blas():
            return self._run()

    def _run(self) -> SpecimenDiagnosis:
        options, thinned, everything = self.options, self.thinned, self.protocol
        self._listener.stage("base: the case as declared, its tissue refitted")
        with self.seconds.of("base"):
            assert self.case.specimen is not None
            glued = self.case.specimen.grips == "glued" and options.ends
            forward = Forward(self.case, thinned, GluedEnds(self.case, everything, self.device), glued)
            fitting = Fitting(noise_factor(thinned), thinned.mask(thinned.to_fit))
            effects, rejected = effects_of(self.case, thinned, options.candidates)
            base = fitting.fit(forward, (), np.zeros((len(thinned), 0)), np.zeros(len(forward.nuisances)), 1.0)
        if base is None:
            raise InputError(f"{self.case.path}: the declared law finds no state in the tests")
        with self.seconds.of("sets of causes"):
            sets = Sets(fitting, effects, base, self._listener)
            ordered = sets.ordered()
        with self.seconds.of("checks"):
            checking = Checker(sets, everything, options.draws, np.random.default_rng([options.seed, 11]))
            p_value = checking.p_left(base)
            hypotheses, chances = [one.hypothesis for one, _ in ordered], np.array([p for _, p in ordered])
            by_posterior, _ = decide(hypotheses, chances, calibration().losses)
            if p_value > options.alpha:
                by_posterior = Decision(NOTHING)
            best = base if by_posterior.verdict == NOTHING else _explaining(ordered, by_posterior)
            checked = checking.of(best)
            grown, worse = grown_errors(checked)
            decision, doubts = after_checks(
                by_posterior, checked.confirmations, checked.p_left, options.alpha, grown, worse
            )
        named = decision.causes if decision.verdict in (NAMED, NAMED_AND_REST) else ()
        with self.seconds.of("next measurement"):
            measurements = _next(ordered, base)
        with self.seconds.of("explained"):
            explained = explained_case(fitting, best) if named else None
        declared = forward.of(everything).stress((), np.zeros(len(forward.nuisances)))
        scores = {"declared": score(everything, declared, None)} | checked.scores
        ranking = _ranking(sets, ordered, effects, checking)
        by_name = {one.name: one for one in ranking}
        nothing = sets.by_names[frozenset()].hypothesis.log_evidence
        return SpecimenDiagnosis(
            case=self.case,
            protocol=everything,
            decision=decision,
            by_posterior=by_posterior,
            doubts=doubts,
            p_value=p_value,
            p_left=checked.p_left,
            named=tuple(replace(by_name[name], values=_values(best, name)) for name in named),
            ranking=ranking,
            rejected=rejected,
            combinations=tuple(
                Combination(one.hypothesis.causes, one.hypothesis.log_evidence - nothing, p, one.fit is not None)
                for one, p in ordered[:_TOLD]
            ),
            assumed=tuple(sorted(best.names)),
            where=where_it_shows(everything, checked.stresses["refitted"], checked.stresses["explained"])
            if best is not base
            else None,
            next_measurement=measurements,
            smallest=smallest_of(sets.about(base)),
            scores=scores,
            stresses={"declared": declared} | checked.stresses,
            improvement=checked.improvement,
            confirmations=checked.confirmations,
            explained=explained,
            assumptions=assumptions_of(best, everything, checking.folds.by_test),
            remarks=tuple(
                f"{one.effect.name} is not simulated by a run: the explained case is fitted without it"
                for one in best.assumed
                if not one.effect.runs
            ),
            by_test=checking.folds.by_test,
            seconds=self.seconds,
        )


def _explaining(ordered: Sequence[tuple[CauseSet, float]], decision: Decision) -> Fit:
    """The most probable fit that has all causes of a verdict; of one that speaks of none, of all with any."""
    fits = [one.fit for one, _ in ordered if one.fit is not None and one.names]
    wanted = {name for name in decision.causes if name != UNKNOWN}
    if decision.verdict not in (NAMED, NAMED_AND_REST):
        wanted = set()
    nothing = next(one.fit for one, _ in ordered if not one.names)
    assert nothing is not None
    return next((fit for fit in fits if wanted <= fit.names), nothing)


def _next(ordered: Sequence[tuple[CauseSet, float]], base: Fit) -> tuple[Measurement, ...]:
    """What would tell the two most probable sets with mechanisms of a run apart, or the only one from none."""
    fits: dict[frozenset[str], Fit] = {}
    for one, _ in ordered:
        if one.fit is not None:
            runs = frozenset(own.effect.name for own in one.fit.assumed if own.effect.runs)
            fits.setdefault(runs, one.fit)
    first = [fit for runs, fit in fits.items() if runs][:2]
    return next_measurements(first[0], first[1] if len(first) > 1 else base) if first else ()


def _values(fit: Fit, name: str) -> tuple[Value, ...]:
    return values_of(fit, [one.effect.name for one in fit.assumed].index(name))


def _ranking(
    sets: Sets, ordered: Sequence[tuple[CauseSet, float]], effects: Sequence[Effect], checking: Checker
) -> tuple[Ranked, ...]:
    """Every cause alone, that which most probably acts first, and what has no name."""
    nothing = sets.by_names[frozenset()].hypothesis.log_evidence
    found = []
    for effect in (*effects, None):
        name = UNKNOWN if effect is None else effect.name
        alone = sets.by_names.get(frozenset({name}))
        probability = sum(p for one, p in ordered if name in one.names)
        change, d = None, 0.0
        if alone is not None and alone.fit is not None:
            change = checking.heldout_rms(alone.fit) - checking.heldout_rms(sets.base)
            d = _detectability(sets.base, alone.fit)
        fit = next((one.fit for one, _ in ordered if name in one.names and one.fit is not None), None)
        one = None if fit is None or effect is None else next(a for a in fit.assumed if a.effect.name == name)
        found.append(
            Ranked(
                name=name,
                kind=Kind.UNKNOWN if effect is None else effect.kind,
                sentence="" if effect is None else effect.sentence,
                log_evidence=float("-inf") if alone is None else alone.hypothesis.log_evidence - nothing,
                probability=probability,
                detectability=d,
                change=change,
                values=() if one is None or fit is None else _values(fit, name),
                region="" if one is None else one.variant.region,
            )
        )
    return tuple(sorted(found, key=lambda one: (-one.probability, -one.log_evidence)))


def _detectability(base: Fit, fit: Fit) -> float:
    """Length of what a fit changes, in standard deviations of noise and nuisances about the base."""
    moved = (fit.stress - base.stress)[base.rows]
    return float(np.linalg.norm(base.model.standardised(moved)))
