"""Rows that stand in a recording twice are one row, with the weights of both."""

from dataclasses import replace

import numpy as np
import pytest

from warpbrain.recordings.points import distinct_rows
from warpbrain.recordings.recording import PointsRecording

POINTS = np.array([[0.0, 0.0, 0.1], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, 0.1]])
MOVED = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 2.0]])


@pytest.fixture
def recording():
    return PointsRecording(name="p", file="p.csv", points=POINTS, displacement=MOVED)


def test_copies_are_one_row(recording):
    rows, weights = distinct_rows(recording, np.array([2, 1, 0, 3]))
    assert (rows.tolist(), weights.tolist()) == ([2, 1, 3], [2.0, 1.0, 1.0])
    given = replace(recording, weights=np.array([0.5, 3.0, 0.25, 1.0]))
    assert distinct_rows(given, np.arange(4))[1].tolist() == [0.75, 3.0, 1.0]


@pytest.mark.parametrize("what", ["time", "sigmas"])
def test_what_differs_in_time_or_noise_is_no_copy(recording, what):
    other = replace(recording, **{what: np.array([1.0, 1.0, 2.0, 1.0])})
    assert distinct_rows(other, np.arange(4))[0].tolist() == [0, 1, 2, 3]
