"""Electrodes as BIDS has them."""

import json

import numpy as np
import pytest

from warpbrain.problems import Problems, Unreadable
from warpbrain.recordings.electrodes import read_electrodes

TEXT = "name\tx\ty\tz\tsize\nLA1\t10\t-20\t5.5\t5\nREF\tn/a\tn/a\tn/a\tn/a\nLA2\t12\t-20\t5\t5\n"


def read(folder, text=TEXT, side=None, name="sub-01_ses-1_electrodes.tsv"):
    (folder / name).write_text(text, encoding="utf-8")
    if side is not None:
        (folder / "sub-01_coordsystem.json").write_text(json.dumps(side), encoding="utf-8")
    problems = Problems()
    try:
        return read_electrodes(folder / name, problems), problems
    except Unreadable:
        return None, problems


def test_positions_move_and_the_rest_stays(tmp_path):
    electrodes, problems = read(tmp_path)
    assert electrodes.labels == ("LA1", "LA2")
    np.testing.assert_allclose(electrodes.points, [[0.01, -0.02, 0.0055], [0.012, -0.02, 0.005]])
    assert "taken for mm" in problems.remarks[0]
    moved = electrodes.moved_text(electrodes.points + np.array([0.001, 0.0, -0.0025]))
    expected = "name\tx\ty\tz\tsize\nLA1\t11\t-20\t3\t5\nREF\tn/a\tn/a\tn/a\tn/a\nLA2\t13\t-20\t2.5\t5\n"
    assert moved == expected


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001)])
def test_the_unit_is_that_of_the_coordinate_system(tmp_path, unit, metres):
    side = {"iEEGCoordinateSystem": "ScanRAS", "iEEGCoordinateUnits": unit}
    electrodes, problems = read(tmp_path, side=side)
    np.testing.assert_allclose(electrodes.points[0], np.array([10, -20, 5.5]) * metres)
    assert problems.remarks == []
    assert electrodes.moved_text(electrodes.points) == TEXT


@pytest.mark.parametrize(
    ("text", "side", "message"),
    [
        (TEXT, {"iEEGCoordinateSystem": "Pixels", "iEEGCoordinateUnits": "pixels"}, "iEEGCoordinateSystem: found 'Pix"),
        (TEXT, {"EEGCoordinateSystem": "CapTrak", "EEGCoordinateUnits": "mm"}, "EEGCoordinateSystem: found 'CapTrak'"),
        (TEXT, {"iEEGCoordinateSystem": "ACPC", "iEEGCoordinateUnits": "inch"}, "iEEGCoordinateUnits: found 'inch'"),
        (TEXT, {"iEEGCoordinateSystem": "ACPC", "iEEGCoordinateUnits": ["mm"]}, "iEEGCoordinateUnits: found '['mm']'"),
        (TEXT, {"iEEGCoordinateSystem": "ACPC"}, "iEEGCoordinateUnits: found 'None'"),
        (TEXT.replace("5.5", "five"), None, "row 2: found position '10 -20 five'"),
        (TEXT.replace("12\t-20", "12"), None, "row 4: found 4 fields, expected 5"),
        (TEXT.replace("\ty", "\tv"), None, "header: found no column 'y'"),
        ("name\tx\ty\tz\nA\tn/a\tn/a\tn/a\n", None, "found no electrode with a position"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, side, message):
    electrodes, problems = read(tmp_path, text, side)
    assert electrodes is None
    assert message in str(problems.found[0])
