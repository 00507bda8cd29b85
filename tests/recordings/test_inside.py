"""Points outside the mesh are problems, and the usual mistakes are named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shapes import box

from warpbrain.mesh import TetMesh
from warpbrain.problems import Problems
from warpbrain.recordings.recording import PointsRecording

MESH = box((5, 5, 5), (0.1, 0.1, 0.1))
FILE = Path("case/recordings/p.csv")


def checked(points, mesh: TetMesh = MESH, **keys) -> Problems:
    problems = Problems()
    points = np.asarray(points, dtype=float)
    recording = PointsRecording(name="p", file="p.csv", points=points, displacement=np.zeros_like(points), **keys)
    recording.check(mesh, FILE, problems)
    return problems


INSIDE = np.random.default_rng(0).uniform(0.01, 0.09, (30, 3))


def test_points_within_an_edge_are_no_problem():
    assert not checked([*INSIDE, [0.05, 0.05, 0.12]])
    assert not checked([[9.0, 9, 9]], outside="nearest")


def test_rows_at_one_place_are_no_dot():
    assert "multiplied by 1000 they would not" in checked(0.001 * INSIDE + 0.05).found[0].cure
    assert not checked(np.tile(INSIDE[0], (20, 1)))


def test_points_farther_away_are():
    problems = checked([*INSIDE, [0.05, 0.05, 0.15], [0.05, 0.05, 0.2]])
    assert [problem.place for problem in problems.found] == ["point 32", "point 31"]
    first, second = problems.found
    assert "the farthest of 2 of 32 points outside: (50, 50, 200) mm RAS is 100 mm outside the mesh" in first.message
    assert "expected within one edge length, 25.2 mm" in first.message
    assert 'outside = "nearest"' in first.cure
    assert second.message.startswith("(50, 50, 150) mm RAS is 50 mm outside")
    assert all(len(problem.message) < 200 for problem in problems.found)


def test_of_a_point_that_moves_it_is_said_once():
    ids = (*(f"p{i}" for i in range(30)), "far", "far")
    points = [*INSIDE, [0.05, 0.05, 0.2], [0.05, 0.05, 0.2]]
    assert [problem.place for problem in checked(points, ids=ids).found] == ["id 'far'"]


@pytest.mark.parametrize(
    ("factors", "mistake"),
    [
        (1e-3, "multiplied by 1000"),
        (1e3, "divided by 1000"),
        (np.array([-1, -1, 1]), "signs of x and y"),
        (np.array([1, 1, -1]), 'outside = "nearest"'),
    ],
)
def test_mistakes_that_are_recognised(factors, mistake):
    shift = np.array([0.2, 0.1, 0.3])
    problems = checked((INSIDE + shift) * factors, replace(MESH, points=MESH.points + shift))
    assert len(problems.found) == 1
    assert mistake in problems.found[0].cure
    assert "of 30 of 30 points outside" in problems.found[0].message
