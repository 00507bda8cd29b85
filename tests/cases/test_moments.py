"""A case at the times of its recordings, and how many numbers these hold."""

from dataclasses import replace

import numpy as np
import pytest
from changing_block import DOWN, block, falling, level, recorded, without

from warpbrain.cases.boundary import Displaced, Forced
from warpbrain.cases.case import Case
from warpbrain.cases.checking import check_case, numbers_to_fit, too_few_to_diagnose
from warpbrain.cases.moments import Moments, case_at, recorded_times
from warpbrain.cases.reading import read_case
from warpbrain.cases.writing import write_case
from warpbrain.errors import InputError
from warpbrain.estimation.observations import Observations
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.recordings.recording import PointsRecording
from warpbrain.worlds.body.hypotheses import require_observable


def marker(times: int, **more) -> PointsRecording:
    """One marker at some times."""
    where = np.tile([0.02, 0.03, 0.05], (times, 1))
    moved = 1e-3 * np.linspace(0.1, 1.0, times)[:, None] * [0.3, 0.0, -1.0]
    series = np.linspace(5.0, 85.0, times)
    return PointsRecording(name="marker", file="m.csv", points=where, displacement=moved, time=series, **more)


@pytest.mark.parametrize("times", [3, 4, 5, 17])
def test_every_time_of_a_marker_counts(times: int, tmp_path) -> None:
    case = replace(block(3), recordings=(marker(times, sigma=1e-4),))
    observations = Observations.to_fit(case)
    assert sum(one.size * len(one.rows) for one in observations.recordings) == numbers_to_fit(case) == 3 * times
    # what `cases check` says is what `diagnose` does
    said = [remark for remark in check_case(write_case(tmp_path / "case", case)).remarks if "diagnose" in remark]
    if times < 5:
        assert f"{3 * times} numbers: too few" in said[0]
        with pytest.raises(InputError, match=f"{3 * times} numbers: too few"):
            require_observable(case)
    else:
        assert said == []
        require_observable(case)


def test_a_marker_is_counted_once() -> None:
    assert marker(17).content.startswith("1 tracked point at 17 times, moved by 0.6")
    assert replace(marker(2), time=None, points=np.eye(2, 3)).content.startswith("2 tracked points, moved by")


def test_what_has_no_weight_or_no_time_is_not_counted() -> None:
    weights = np.ones(17)
    weights[:2] = 0.0
    case = replace(block(3), recordings=(marker(17, sigma=1e-4, weights=weights),))
    assert numbers_to_fit(case) == 45
    earlier = replace(marker(17, sigma=1e-4), time=np.linspace(0.0, 80.0, 17))
    # at 0 s nothing acts yet
    assert numbers_to_fit(replace(case, recordings=(earlier,))) == 48
    assert numbers_to_fit(replace(case, recordings=(replace(earlier, reference=40.0),))) == 45
    assert too_few_to_diagnose(replace(case, recordings=(replace(earlier, role="check"),)))


def test_a_noise_that_is_not_declared_is_estimated_from_all_times(tmp_path) -> None:
    few = replace(block(3), recordings=(marker(3),))
    with pytest.raises(InputError, match="'marker' holds 9 numbers: too few"):
        Observations.to_fit(few)
    assert any("holds 9 numbers" in remark for remark in check_case(write_case(tmp_path / "case", few)).remarks)
    assert Observations.to_fit(replace(few, recordings=(marker(4),))).recordings[0].sigma is None


def test_what_acts_at_a_time_is_held_at_its_size() -> None:
    case = replace(
        block(3, (*falling((10.0, 80.0), (0.05, 0.02)), Pressure(nodes="side", value=50.0, ramp=((0, 0), (100, 1))))),
        boundaries=(
            *block(3).boundaries,
            Forced(name="push", nodes="side", total=(0.1, 0.0, 0.0), ramp=((0, 1), (100, 3))),
            Displaced(name="plate", nodes="side", times=(0.0, 100.0), values=((0.0, 0.0, 0.0), (0.01, 0.0, 0.002))),
        ),
    )
    held = case_at(case, 45.0)
    first, second, pressure = held.mechanisms
    for time in (0.0, 45.0, np.inf):
        assert [first.factor(time), second.factor(time), pressure.factor(time)] == pytest.approx([0.5, 0.5, 0.45])
    assert held.boundaries[1].ramp == ((0.0, 1.9),)
    np.testing.assert_allclose(held.boundaries[2].final, [0.0045, 0.0, 0.0009])
    # who has no turn does not act
    assert [m.csf_level for m in case_at(case, 5.0).mechanisms if isinstance(m, Gravity)] == [0.05]


def test_times_at_which_the_same_acts_are_one_state() -> None:
    case = replace(block(3), recordings=(marker(17, sigma=1e-4),))
    moments = Moments.recorded(case)
    assert moments.cases == (case,) and set(moments.numbers) == {0} and len(moments.times) == 17
    growing = replace(case, mechanisms=(Pressure(nodes="side", value=50.0, ramp=((5, 0), (45, 1))),))
    moments = Moments.recorded(growing)
    # 5, 10, ... 45 s, and as it is then until the end
    assert len(moments.cases) == 9 and moments.numbers[8:] == (8,) * 9
    between = replace(growing, recordings=(marker(17, sigma=1e-4, reference=2.0),))
    assert recorded_times(between, ("fit",))[0] == 2.0


def test_a_reference_and_turns_are_written_and_read(tmp_path) -> None:
    truth = block(3, falling((10.0, 80.0), (0.05, 0.02)))
    case = replace(truth, recordings=(recorded(truth, (80.0,), 4, reference=10.0),))
    back = read_case(write_case(tmp_path / "case", case))
    assert [m.csf_level for m in back.mechanisms] == pytest.approx([0.05, 0.02])
    assert back.recordings[0].reference == 10.0
    assert not check_case(tmp_path / "case" / "case.toml").problems


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        (block(3, (level(0.05), level(0.02))), "a second 'gravity': it would act twice"),
        (block(3, (level(0.05, ((0, 1), (9, 0.5))), level(0.02, ((0, 0), (9, 1))))), "a second 'gravity'"),
        (replace(block(3), recordings=(marker(1, reference=5.0),)), "no row is of another time than 5 s"),
        (replace(block(3), recordings=(marker(1, reference=-5.0),)), "reference"),
        (replace(block(3), recordings=(replace(marker(1), time=np.zeros(1)),)), "no row is of a time after 0 s"),
    ],
)
def test_what_means_nothing_is_refused(case: Case, expected: str, tmp_path) -> None:
    with pytest.raises(InputError, match=expected):
        read_case(write_case(tmp_path / "case", case))


def test_a_load_alone_may_be_larger_than_one() -> None:
    twice = Gravity(direction=DOWN, density=1000.0, ramp=((0.0, 2.0),))
    assert without(block(3, (twice,)), []).mechanisms == ()
    assert case_at(block(3, (twice,)), 1.0).mechanisms[0].factor() == 2.0
