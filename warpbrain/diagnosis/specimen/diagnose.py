"""What was left out of a specimen: base, then one addition after the other until nothing significant is left."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.options import DiagnosisOptions
from warpbrain.diagnosis.result import Measurement, Ranked
from warpbrain.diagnosis.specimen.candidates import candidates_of
from warpbrain.diagnosis.specimen.confirming import confirm
from warpbrain.diagnosis.specimen.explaining import explained_case
from warpbrain.diagnosis.specimen.fitting import Fitting, SpecimenFit
from warpbrain.diagnosis.specimen.folds import folds_of, held_out
from warpbrain.diagnosis.specimen.forward import Forward, Hypothesis
from warpbrain.diagnosis.specimen.measuring import next_measurements
from warpbrain.diagnosis.specimen.noise import noise_factor
from warpbrain.diagnosis.specimen.protocol import protocol_of
from warpbrain.diagnosis.specimen.result import Score, SpecimenDiagnosis
from warpbrain.diagnosis.specimen.sentences import assumptions_of, sentence_of
from warpbrain.diagnosis.specimen.showing import smallest_of, where_it_shows
from warpbrain.diagnosis.specimen.stage import Candidate, Stage, Staging
from warpbrain.diagnosis.specimen.verdict import conclude
from warpbrain.errors import InputError
from warpbrain.recordings.recording import TestRecording
from warpbrain.simulation.specimen import specimen_of
from warpbrain.threads import one_thread_of_blas
from warpbrain.worlds.body.values import Value
from warpbrain.worlds.listener import Listener

Floats = NDArray[np.float64]

#: Additions at most, and rows below which nothing is concluded.
_STAGES, _FEWEST = 6, 15


class DiagnosingSpecimen:
    """Diagnoses the tests of one case.

    Parameters
    ----------
    case : Case
        With a specimen.
    options : DiagnosisOptions, optional
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
        options: DiagnosisOptions | None = None,
        device: str | None = None,
        listener: Listener | None = None,
    ) -> None:
        self.case, self.device = case, device
        self.options = options or DiagnosisOptions()
        self.listener = listener or Listener()
        self.seconds: dict[str, float] = {}
        recordings = [one for one in case.recordings if isinstance(one, TestRecording)]
        specimen = specimen_of(case)
        rows = sum(len(one.imposed) for one in recordings if one.role == "fit")
        if rows < _FEWEST:
            raise InputError(
                f"{case.path}: [[recording]] role = 'fit': {rows} rows of tests: too few for any conclusion; "
                f"{_FEWEST - rows} more would do"
            )
        for one in recordings:
            if specimen.grips == "lubricated" and one.mode != "axial":
                raise InputError(
                    f"{case.path}: [[recording]] '{one.name}' mode '{one.mode}': lubricated grips slide, nothing "
                    "transmits it"
                )
            if not np.abs(one.response).any():
                raise InputError(f"{case.path}: [[recording]] '{one.name}' file '{one.file}': every response is 0")
        self.protocol = protocol_of(specimen, recordings)

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
        options, protocol = self.options, self.protocol
        rng = np.random.default_rng([options.seed, 11])
        self.listener.stage("base: the case as declared, its tissue refitted")
        with self._timed("base"):
            forward = Forward(self.case, protocol, self.device, options.ends)
            fitting = Fitting(forward, noise_factor(protocol))
            folds = folds_of(protocol)
            hypothesis = Hypothesis()
            declared = forward.stress(hypothesis, np.zeros(forward.size(hypothesis)))
            base = fitting.fit(hypothesis, folds.fitted)
        if base is None:
            raise InputError(f"{self.case.path}: the declared law finds no state in the tests")
        ways, rejected = candidates_of(self.case, protocol, options.candidates)
        staging = Staging(fitting, folds, ways, options.alpha, options.draws, rng, self.listener.stage)
        stages: list[Stage] = []
        with self._timed("stages"):
            fit = base
            for number in range(_STAGES):
                self.listener.stage(f"what is left with {' and '.join(fit.hypothesis.kinds) or 'nothing added'}")
                self.listener.progress(number / _STAGES, f"addition {number + 1}")
                stages.append(staging.run(fit))
                accepted = stages[-1].accepted
                if accepted is None or accepted.fit is None:
                    break
                self.listener.stage(f"added: {accepted.kind}")
                fit = accepted.fit
        added = fit is not base
        with self._timed("held out"):
            forward.use_shape_of(forward.material(fit.hypothesis, fit.z))
            final_predicted, final_stress = (
                held_out(fitting, fit, folds) if added else (stages[0].predicted, stages[0].stress)
            )
            confirmations = confirm(fitting, fit, final_predicted, folds, rng)
        verdict = conclude(stages, confirmations, options.alpha)
        stresses = {"declared": declared, "refitted": base.stress, "heldout refitted": stages[0].stress}
        scores = {"declared": self._score(declared, None), "refitted": self._score(base.stress, stages[0].stress)}
        improvement = None
        if added:
            stresses |= {"explained": fit.stress, "heldout explained": final_stress}
            scores["explained"] = self._score(fit.stress, final_stress)
            improvement = final_predicted.improvement(stages[0].predicted, rng)
        named = tuple(self._named(forward, stages, fit, kind) for kind in verdict.kinds if added and verdict.named)
        smallest = smallest_of(base, stages[0].columns)
        with self._timed("next measurement"):
            measurements = self._next(forward, stages)
        with self._timed("explained"):
            explained = explained_case(fitting, fit, folds) if named else None
        ranking = tuple(self._ranked(forward, one, stages[0]) for one in stages[0].candidates)
        remarks = tuple(
            f"{one.kind} is not simulated by a run: the explained case is fitted without it"
            for one in fit.hypothesis.assumptions
            if not one.runs
        )
        return SpecimenDiagnosis(
            case=self.case,
            protocol=protocol,
            verdict=verdict.verdict,
            sentence=sentence_of(verdict, stages, named, scores, smallest),
            p_value=stages[0].p_value,
            named=named,
            group=verdict.group,
            ranking=ranking,
            rejected=rejected,
            stages=tuple(stages),
            where=where_it_shows(protocol, base.stress, fit.stress) if added else None,
            next_measurement=measurements,
            smallest=smallest,
            scores=scores,
            stresses=stresses,
            improvement=improvement,
            confirmations=confirmations,
            explained=explained,
            assumptions=assumptions_of(self.case, protocol, forward, fit, folds.by_test),
            remarks=remarks,
            by_test=folds.by_test,
            seconds=self.seconds,
        )

    def _score(self, stress: Floats, held: Floats | None) -> Score:
        protocol = self.protocol
        fitted = protocol.mask(protocol.to_fit)
        errors = protocol.observed - stress
        check = {
            protocol.tests[k].name: float(np.sqrt(np.mean(errors[protocol.rows[k]] ** 2))) for k in protocol.to_check
        }
        outside = None if held is None else float(np.sqrt(np.mean((protocol.observed - held)[fitted] ** 2)))
        return Score(float(np.sqrt(np.mean(errors[fitted] ** 2))), outside, check)

    def _ranked(self, forward: Forward, one: Candidate, stage: Stage) -> Ranked:
        values: tuple[Value, ...] = ()
        d, change, why = 0.0, None, ""
        if one.fit is not None:
            values = values_at(forward, one.fit, len(one.fit.hypothesis.assumptions) - 1)
            moved = stage.without.explanation.whitened((one.fit.stress - stage.without.stress)[one.fit.rows][:, None])
            d = stage.without.explanation.detectability(moved[:, 0], stage.without.kappa)
        if one.stress is not None:
            rows = ~np.isnan(one.stress)
            own, other = (np.sqrt(np.mean((self.protocol.observed - x)[rows] ** 2)) for x in (one.stress, stage.stress))
            change = float(own - other)
        if one.fit is None and one.kind != "unknown":
            why = "no fit with it stands"
        region = one.assumption.region if one.assumption is not None else ""
        return Ranked(
            one.kind, one.physics, one.log_evidence, one.probability, d, change, values, None, None, region, why
        )

    def _named(self, forward: Forward, stages: Sequence[Stage], fit: SpecimenFit, kind: str) -> Ranked:
        """A kind as the last fit has it, with the probability of the stage that named it."""
        number = fit.hypothesis.kinds.index(kind)
        stage = next(one for one in stages if one.accepted is not None and one.accepted.kind == kind)
        assert stage.accepted is not None
        at_first = self._ranked(forward, stage.accepted, stage)
        values = tuple(
            value
            for k, own in enumerate(fit.hypothesis.kinds)
            if own == kind
            for value in values_at(forward, fit, k, "" if k == number else f", branch {k + 1}")
        )
        return Ranked(
            kind, at_first.physics, at_first.log_evidence, at_first.probability, at_first.detectability,
            at_first.heldout_rmse_change, values, None, None, at_first.region,
        )  # fmt: skip

    def _next(self, forward: Forward, stages: Sequence[Stage]) -> tuple[Measurement, ...]:
        """What would tell the two most probable registered mechanisms of the last stage with any apart."""
        for stage in reversed(stages):
            own = [one.fit for one in stage.candidates if one.assumption is not None and one.assumption.runs]
            fits = [one for one in own if one is not None]
            if fits:
                return next_measurements(forward, fits[0], fits[1] if len(fits) > 1 else stage.without)
        return ()

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        begun = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begun


def values_at(forward: Forward, fit: SpecimenFit, number: int, suffix: str = "") -> tuple[Value, ...]:
    """Parameters of an assumption after a fit, with standard deviations to first order."""
    one = fit.hypothesis.assumptions[number]
    first = len(forward.nuisances(fit.hypothesis)) + sum(len(a.mean) for a in fit.hypothesis.assumptions[:number])
    z = fit.z[first : first + len(one.mean)]
    here = np.array(one.values(one.mean + one.sd * z))
    step = 1e-3
    slopes = [
        (np.array(one.values(one.mean + one.sd * (z + step * move))) - here) / step for move in np.eye(len(one.mean))
    ]
    slope = np.array(slopes).T
    covariance = fit.covariance[first : first + len(one.mean), first : first + len(one.mean)]
    sd = np.sqrt(np.maximum(np.diag(slope @ covariance @ slope.T), 0.0))
    return tuple(
        Value(f"{name}{suffix}", float(value), float(s), unit)
        for name, value, s, unit in zip(one.names, here, sd, one.units, strict=True)
    )
