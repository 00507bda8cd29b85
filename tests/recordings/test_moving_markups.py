"""Markups of 3D Slicer with their points elsewhere."""

import json

import numpy as np
import pytest
from landmark_files import START, fcsv, markup

from warpbrain.problems import Problems
from warpbrain.recordings.markups import read_markup

SHIFT = np.array([0.001, -0.002, 0.003])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("F.mrk.json", markup(*START)),
        ("F.mrk.json", markup(*START, coordinateSystem="RAS", measurements=[{"name": "volume"}])),
        ("F.fcsv", fcsv(*START)),
        ("F.fcsv", fcsv(*START, system="# CoordinateSystem = 0\n")),
    ],
)
def test_points_move_in_the_axes_of_the_file(tmp_path, name, text):
    (tmp_path / name).write_text(text, encoding="utf-8")
    problems = Problems()
    before = read_markup(tmp_path / name, problems)
    after_text = before.moved_text(before.points + SHIFT)
    (tmp_path / f"after-{name}").write_text(after_text, encoding="utf-8")
    after = read_markup(tmp_path / f"after-{name}", problems)
    assert not problems
    np.testing.assert_allclose(after.points - before.points, np.tile(SHIFT, (2, 1)), atol=1e-9)
    assert after.labels == before.labels
    # written where it was, everything else is as it was
    same = before.moved_text(before.points)
    if name.endswith("json"):
        assert json.loads(same) == json.loads(text)
    else:
        keep = [line for line in text.splitlines() if line.startswith("#")]
        assert [line for line in same.splitlines() if line.startswith("#")] == keep
        assert [row.split(",")[7:] for row in same.splitlines()[3:]] == [
            row.split(",")[7:] for row in text.splitlines()[3:]
        ]
