"""Checks are by the model itself: held-out rows by its conditional, errors of all rows, memory that stiffens."""

from dataclasses import replace

import numpy as np
import pytest
from rods import ROD, cycle, noisy, rod_test, viscous
from testing_machine import case_of

from warpbrain.inference.decide import CANNOT_SAY, NAMED, NAMED_AND_REST, Confirmation, Decision, after_checks
from warpbrain.physics.words import Value
from warpbrain.worlds.options import DiagnosisOptions
from warpbrain.worlds.specimen.checks import CheckResults, folds_of, grown_errors, held_out
from warpbrain.worlds.specimen.diagnose import DiagnosingSpecimen
from warpbrain.worlds.specimen.effects import effects_of, stiffening
from warpbrain.worlds.specimen.fit import Component, Forward, fit
from warpbrain.worlds.specimen.glued_ends import GluedEnds
from warpbrain.worlds.specimen.protocol import protocol_of
from warpbrain.worlds.specimen.result import Score


def cycles(*durations, seed=2, roles=None):
    rng, tests = np.random.default_rng(seed), []
    for number, duration in enumerate(durations):
        time, stretch = cycle(duration)
        stress = noisy(viscous(time, stretch, 1.5, 12.0), rng)
        role = "fit" if roles is None else roles[number]
        tests.append(replace(rod_test(f"{duration:g} s", stretch, stress, time), role=role))
    return replace(case_of(ROD), recordings=tuple(tests))


def base_of(case):
    everything = protocol_of(case.specimen, case.recordings)
    forward = Forward(case, everything.thinned, GluedEnds(case, everything), False)
    return everything, fit(forward, (), np.zeros(len(forward)))


def test_held_out_rows_are_the_conditional_of_the_model():
    _, base = base_of(cycles(400.0, 40.0))
    held = base.forward.protocol.mask([1])
    again = base.refitted_to(~held)
    # an independent conditional: by the inverse of the joint covariance
    U = again.columns
    S = base.scale**2 * base.forward.noise @ base.forward.noise.T + U @ U.T
    P = np.linalg.inv(S)
    r = again.residual
    mean = -np.linalg.solve(P[np.ix_(held, held)], P[np.ix_(held, ~held)] @ r[~held])
    e = r[held] - mean
    log = -0.5 * (
        e @ P[np.ix_(held, held)] @ e - np.linalg.slogdet(P[np.ix_(held, held)])[1] + held.sum() * np.log(2 * np.pi)
    )
    stress, log_density = held_out(base, [held])
    assert log_density == pytest.approx(log, abs=1e-6)
    np.testing.assert_allclose(
        stress[held], (again.stress - U @ again.z)[held] + mean, atol=1e-6 * np.abs(base.stress).max()
    )


@pytest.mark.slow(3)
def test_errors_are_of_all_recorded_rows():
    case = cycles(400.0, 40.0, 100.0, roles=("fit", "fit", "check"))
    found = DiagnosingSpecimen(case, DiagnosisOptions(candidates=("viscoelasticity",), draws=100), "cpu").run()
    assert len(found.protocol) == 3 * 161
    assert len(found.protocol.thinned) < len(found.protocol)
    for name in ("refitted", "explained"):
        rows = found.protocol.rows[2]
        error = found.protocol.observed[rows] - found.stresses[name][rows]
        assert found.scores[name].check["100 s"] == pytest.approx(float(np.sqrt(np.mean(error**2))))
        assert not np.isnan(found.stresses[f"heldout {name}"][: rows.start]).any()
    assert found.scores["explained"].check["100 s"] < 0.5 * found.scores["refitted"].check["100 s"]


@pytest.mark.slow
def test_a_viscosity_stays_where_more_tests_are_fitted():
    for durations in ((400.0, 40.0), (400.0, 40.0, 100.0, 200.0)):
        options = DiagnosisOptions(candidates=("viscoelasticity", "softening", "drift of the zero"), draws=100)
        found = DiagnosingSpecimen(cycles(*durations), options, "cpu").run()
        assert "viscoelasticity" in [one.kind for one in found.named], durations


def test_what_stiffens_is_what_tissue_remembers_too():
    case = cycles(40.0)
    everything, _ = base_of(case)
    forward = Forward(case, everything, GluedEnds(case, everything), False)
    effect = stiffening(case, everything)
    assert effects_of(case, everything)[0][-1].name == "unknown"
    viscous_effect = next(one for one in effects_of(case, everything)[0] if one.name == "viscoelasticity")
    variant = viscous_effect.variants[3]
    both = (
        Component(viscous_effect, variant, variant.trials[0], 1.0),
        Component(effect, effect.variants[0], effect.variants[0].trials[0], 1.0),
    )
    z = np.zeros(len(forward) + sum(map(len, both)))
    z[-len(both[1]) - len(both[0])] = 1.0
    plain = forward.stress(both, z)
    z[-1] = 1.0
    k = effect.variants[0].sd[0]
    strain = everything.tests[0].strain
    np.testing.assert_allclose(
        forward.stress(both, z), plain * np.exp(k * (strain**2 + 2.0 / strain - 3.0)), rtol=1e-12
    )


def test_the_sentence_of_stiffening_has_the_sign_of_what_was_found():
    case = cycles(40.0)
    effect = stiffening(case, protocol_of(case.specimen, case.recordings))
    for k, word in ((3.0, " more than"), (-3.0, " less than")):
        assert word in effect.sentence_of((Value("k", k, 0.5, ""),))
    assert "more or less" in effect.sentence_of(())


def test_a_check_that_fails_is_said():
    good, bad = (Confirmation(name, 9.0, 5.0, (0.5, 0.4, 0.6), p) for name, p in (("a", 0.01), ("b", 0.4)))
    scores = {"refitted": Score(9.0, 9.0, {"hold": 1.0}), "explained": Score(2.0, 3.0, {"hold": 2.0})}
    checked = CheckResults(0.5, scores, {}, None, (good, bad))

    def said(names: tuple[str, ...], checked: CheckResults) -> tuple[Decision, tuple[str, ...]]:
        return after_checks(Decision(NAMED, names), (good, bad), checked.p_left, 0.05, *grown_errors(checked))

    decision, doubts = said(("a", "b"), checked)
    assert decision == Decision(NAMED_AND_REST, ("a",))
    assert any("'hold', which was not fitted, is predicted worse" in one for one in doubts)
    assert any("b is not named: patterns that mean nothing predict as well" in one for one in doubts)
    assert said(("b",), checked)[0] == Decision(CANNOT_SAY, ("b",))
    worse = replace(checked, scores=scores | {"explained": Score(2.0, 10.0, {"hold": 0.5})})
    decision, doubts = said(("a",), worse)
    assert decision == Decision(CANNOT_SAY, ("a",)) and "from 9 Pa to 10 Pa" in doubts[0]


def test_folds_of_one_test_are_its_quarters():
    thinned = base_of(cycles(40.0))[0].thinned
    folds = folds_of(thinned)
    assert len(folds) == 4
    assert np.sum(folds, axis=0).tolist() == [1] * len(thinned)
