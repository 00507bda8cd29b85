"""Points that contradict all others are set aside; several beside each other are not."""

from dataclasses import replace

import numpy as np
import pytest

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.diagnosis.gross_errors import gross_errors
from warpbrain.worlds.body.sensors import Sensors, rows_of_points

POINTS = 12


@pytest.fixture
def sensors() -> Sensors:
    """Points of three rows each, then points of one row: as those of a surface are."""
    groups = np.concatenate([np.repeat(np.arange(POINTS), 3), POINTS + np.arange(5)])
    n = len(groups)
    places = 0.05 * groups[:, None] * np.array([1.0, 0.0, 0.0])
    nothing = np.zeros((n, 1))
    rest = (nothing, nothing, np.zeros((n, 6)), np.ones(n), places, np.ones((n, 3)))
    return Sensors(np.zeros(n), np.zeros(n), *rest, groups, np.zeros(n, dtype=int), np.zeros(n), ("points",))


def with_errors(sensors: Sensors, points: list[int]) -> np.ndarray:
    noise = np.random.default_rng(4).normal(size=len(sensors))
    return noise + 9.0 * np.isin(sensors.groups, points)


def set_aside(sensors: Sensors, residual: np.ndarray) -> list[int]:
    smooth = 0.1 * np.column_stack([np.ones(len(sensors)), sensors.positions[:, 0]])
    rows = gross_errors(sensors, Explanation(np.eye(len(sensors)), smooth), 1.0, residual)
    found = np.unique(sensors.groups[rows]).tolist()
    assert rows.sum() == np.isin(sensors.groups, found).sum()
    return found


@pytest.mark.parametrize("points", [[], [4], [4, POINTS + 2]])
def test_points_that_stand_out_are_set_aside_with_all_their_rows(sensors: Sensors, points: list[int]) -> None:
    assert set_aside(sensors, with_errors(sensors, points)) == points


def test_several_beside_each_other_are_a_signal(sensors: Sensors) -> None:
    together = replace(sensors, positions=np.where(np.isin(sensors.groups, [3, 4, 5])[:, None], 0.2, sensors.positions))
    residual = with_errors(sensors, [3, 4, 5])
    assert set_aside(sensors, residual) == [3, 4, 5]
    assert set_aside(together, residual) == []


def test_rows_of_points_are_together_by_their_number(sensors: Sensors) -> None:
    some = replace(sensors, groups=np.array([3, 3, 0, 2, 2, 7, 5, 5]), directions=np.ones((8, 3)))
    some.directions[6:] = 0.0
    assert [rows.tolist() for rows in rows_of_points(some)] == [[[2], [5]], [[3, 4], [0, 1]]]


def test_a_force_is_no_gross_error(sensors: Sensors) -> None:
    force = np.isin(sensors.groups, [4])
    residual = with_errors(sensors, [4, POINTS + 2])
    assert set_aside(sensors, residual) == [4, POINTS + 2]
    with_force = replace(sensors, directions=np.where(force[:, None], 0.0, sensors.directions))
    assert set_aside(with_force, residual) == [POINTS + 2]
