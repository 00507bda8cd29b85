"""`points.csv` says again, number by number, what the errors of `diagnosis.json` are made of."""

import csv

import numpy as np
import pytest

from warpbrain.mesh.vtu import read_vtu
from warpbrain.report.diagnosis.files import Recorded


@pytest.fixture(scope="module")
def rows(diagnosed):
    with (diagnosed / "points.csv").open(encoding="utf-8", newline="") as stream:
        lines = list(csv.DictReader(stream))
    words = ("recording", "unit")
    return {
        name: np.array([line[name] if name in words else float(line[name] or "nan") for line in lines])
        for name in lines[0]
    }


@pytest.mark.parametrize("state", ["declared", "refitted", "explained"])
def test_errors_at_what_was_fitted(rows, summary, state):
    # distances of tracked points, three rows each; none is left out
    errors = (rows["observed"] - rows[state])[rows["unit"] == "mm"]
    assert np.sqrt(3.0 * np.mean(errors**2)) == pytest.approx(1000.0 * summary["fit"]["rmse_m"][state], rel=1e-4)


@pytest.mark.parametrize("state", ["refitted", "explained"])
def test_errors_at_what_was_held_out(rows, summary, state):
    errors = rows[f"heldout_error_{state}"]
    expected = 1000.0 * summary["fit"]["heldout_rmse_m"][state]
    assert np.sqrt(3.0 * np.nanmean(errors**2)) == pytest.approx(expected, rel=1e-4)


def test_observed_is_what_was_recorded(rows, small_diagnosis):
    recording = small_diagnosis.case.recordings[0]
    observed = rows["observed"].reshape(-1, 3)
    np.testing.assert_allclose(observed, 1000.0 * recording.displacement, atol=1e-5)


def test_vectors_are_what_is_left_of_points(small_diagnosis):
    vectors = Recorded.of(small_diagnosis).vectors
    recording = small_diagnosis.case.recordings[0]
    np.testing.assert_allclose(vectors.left["declared"], recording.displacement, atol=1e-8)
    assert len(vectors.where) == len(recording.points)


def test_map_says_where_the_data_are_blind(diagnosed, summary):
    fields = read_vtu(diagnosed / "map.vtu").point_data
    above = 1000.0 * summary["map"]["blind_above_n"]
    np.testing.assert_array_equal(fields["blind"] == 1, fields["detectable_force"] > above)
    np.testing.assert_array_equal(fields["significant"] == 1, fields["score"] > summary["map"]["threshold"])
