"""Causes that change while a body is recorded: each is one cause, whose size is found as a function of time."""

from dataclasses import replace

import numpy as np
import pytest
from changing_block import block, falling, recorded, without

from warpbrain.cases.case import Case
from warpbrain.cases.reading import read_case
from warpbrain.cases.writing import write_case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.report.diagnosis.text import when_in_words
from warpbrain.worlds.options import DiagnosisOptions

_OPTIONS = DiagnosisOptions(candidates=("gravity", "pressure"), mesh_error=False, draws=60)
_TIMES, _LEVELS = (10.0, 30.0, 80.0), (0.055, 0.04, 0.015)
#: Between these something is checked.
_UNSEEN = 55.0


def diagnosed(case: Case) -> Diagnosis:
    return Diagnosing(case, _OPTIONS, "cpu").run()


@pytest.fixture(scope="module")
def fallen() -> tuple[Case, Diagnosis]:
    """A level that falls, of which the case says nothing; and the truth."""
    truth = block(4, falling(_TIMES, _LEVELS))
    fitted = recorded(truth, _TIMES)
    unseen = recorded(truth, (_UNSEEN,), name="others", role="check", seed=8)
    return truth, diagnosed(without(truth, [fitted, unseen]))


@pytest.mark.slow(5)
def test_a_level_that_falls_is_one_cause(fallen: tuple[Case, Diagnosis], verify) -> None:
    _, found = fallen
    assert found.verdict == "named" and [one.kind for one in found.named] == ["gravity"]
    assert found.when is not None and found.when.sizes is not None
    sizes = found.when.sizes
    assert (sizes.parameter, sizes.unit, sizes.seconds) == ("csf_level", "mm", _TIMES)
    away = np.abs(np.array(sizes.values) - 1e3 * np.array(_LEVELS)) / sizes.deviations
    verify(
        "level of a fluid at three times as it falls, of which a case says nothing, in standard deviations of it",
        "levels with which the recordings were made",
        float(away.max()),
        2.5,
    )


def test_what_was_found_is_a_case_that_runs(fallen: tuple[Case, Diagnosis], tmp_path) -> None:
    _, found = fallen
    assert found.explained is not None
    back = read_case(write_case(tmp_path / "explained", found.explained))
    assert [mechanism.kind for mechanism in back.mechanisms] == ["gravity"] * 3
    for time in (*_TIMES, _UNSEEN):
        assert sum(mechanism.factor(time) for mechanism in back.mechanisms) == pytest.approx(1.0, abs=0.3)


def test_unseen_times_are_scored_at_their_times(fallen: tuple[Case, Diagnosis]) -> None:
    _, found = fallen
    declared, refitted, explained = found.fit.check
    [unseen] = [one for one in found.case.recordings if one.role == "check"]
    # against the state of the last time it would be as wrong as without the weight
    assert explained < 0.25 * declared and explained < 0.25 * refitted
    assert declared == pytest.approx(np.sqrt(np.mean(np.sum(unseen.displacement**2, axis=1))), rel=1e-6)


def test_the_words_say_how_it_changes(fallen: tuple[Case, Diagnosis]) -> None:
    from dataclasses import asdict

    sizes = asdict(fallen[1].when.sizes)
    said = when_in_words({"seconds": [0.0, 80.0], "probability": None, "course": "", "sizes": sizes})
    assert said.startswith("it changes with time: height of the fluid's surface") and " mm at 80 s" in said
    assert "at 10 s" in said and "at 30 s" in said


@pytest.fixture(scope="module")
def between() -> Diagnosis:
    """A level before and a level after, displacements counted from the state before."""
    truth = block(4, falling((10.0, 80.0), (0.05, 0.02)))
    return diagnosed(without(truth, [recorded(truth, (80.0,), 40, reference=10.0)]))


@pytest.mark.slow(4)
def test_between_two_loaded_states_a_cause_is_what_changed(between: Diagnosis, verify) -> None:
    assert between.verdict == "named" and [one.kind for one in between.named] == ["gravity"]
    assert between.when is not None and between.when.sizes is not None
    before, after = between.when.sizes.values
    # what moves is the weight over the stiffness, which is known to a factor
    modulus = float(np.exp(between.search.fitted_with(frozenset(["gravity"])).refit.state.hypothesis.theta[0]))
    deviation = np.hypot(*between.when.sizes.deviations) / (before - after)
    verify(
        "fall of a fluid's level between two loaded states over the stiffness, over its standard deviation",
        "levels and stiffness with which the recordings were made",
        abs((before - after) / modulus / (30.0 / 1000.0) - 1.0) / deviation,
        1.0,
    )


@pytest.mark.slow(4)
def test_what_is_declared_of_both_states_leaves_nothing_missing(verify) -> None:
    truth = block(4, falling((10.0, 80.0), (0.05, 0.02)))
    found = diagnosed(replace(truth, recordings=(recorded(truth, (80.0,), 40, reference=10.0),)))
    assert found.verdict == "nothing missing"
    declared, _ = found.fit.declared
    verify(
        "root mean square distance of points between two declared levels of a fluid, over that of the noise",
        "noise with which the recordings were made",
        abs(declared / (3.0**0.5 * 5e-5) - 1.0),
        0.2,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "cause",
    [
        Pressure(nodes="side", value=100.0, ramp=((0, 0), (10, 0.1), (30, 0.35), (50, 0.7), (80, 1.0))),
        Swelling(amount=0.1, ramp=((0, 0), (10, 0.05), (30, 0.3), (50, 1.0), (80, 0.6))),
    ],
)
def test_what_grows_is_found_with_its_course(cause, verify) -> None:
    times = (10.0, 30.0, 50.0, 80.0)
    truth = block(5, (cause,))
    options = replace(_OPTIONS, candidates=("gravity", "pressure", "swelling"))
    found = Diagnosing(without(truth, [recorded(truth, times)]), options, "cpu").run()
    assert found.verdict == "named" and [one.kind for one in found.named] == [cause.kind]
    assert found.when is not None and found.when.sizes is not None
    values = np.array(found.when.sizes.values)
    expected = np.array([cause.factor(time) for time in times])
    # how large it is altogether hangs on the stiffness
    verify(
        f"course of a {cause.kind} that changes, relative to its largest size",
        "course with which the recordings were made",
        float(np.abs(values / values[expected.argmax()] - expected).max()),
        0.05,
    )


def test_a_mechanism_that_acts_in_turns_is_one_at_a_time() -> None:
    truth = block(4, falling(_TIMES, _LEVELS))
    by_time = [[m for m in truth.mechanisms if isinstance(m, Gravity) and m.factor(t)] for t in _TIMES]
    assert [len(acting) for acting in by_time] == [1, 1, 1]
