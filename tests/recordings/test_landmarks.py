"""Landmarks from other programs: MNI tags and 3D Slicer markups."""

import numpy as np
import pytest
from landmark_files import START, TAG, fcsv, markup
from recording_files import messages, read, read_content

from warpbrain.frame import Frame


def test_tags(tmp_path):
    points, problems = read_content("points", tmp_path / "l.tag", TAG, Frame("m", "LPS"))
    assert not problems
    np.testing.assert_allclose(points.points, [[0.001, 0.002, 0.003], [-0.004, 0.005, 0.006]])
    np.testing.assert_allclose(points.displacement, [[0, 0, 0.001], [0.001, 0, 0]], atol=1e-18)
    assert points.ids == ("one", "the second")


@pytest.mark.parametrize(
    ("old", "new"), [('0 -1 -1 "one"', ""), ('0 -1 -1 "one"', '""'), ('"the second"', '"one"'), ("\n", "\r\n")]
)
def test_other_tags_that_are_read(tmp_path, old, new):
    points, problems = read_content("points", tmp_path / "l.tag", TAG.replace(old, new))
    assert not problems
    assert len(points.points) == 2
    assert (points.ids is None) == (old != "\n")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("MNI Tag", "Tag", "row 1: found 'Tag Point File'"),
        ("Volumes = 2;", "Volumes = 1;", "row 2: found 'Volumes = 1;', expected 'Volumes = 2;'"),
        ("Points =", "Point", "row 6: found 'Point', expected 'Points ='"),
        (";\n", "\n", "expected 'Volumes = 2;'"),
        ('second";', 'second"', "no semicolon after the points"),
        ("1 2 3 1 2 4", "1 2 3 1 2", "row 7: found 9 fields"),
        ("1 2 3 1 2 4", "1 2 x 1 2 4", "row 7: found '1 2 x 1 2 4', expected 6 numbers"),
        ("1 2 3 1 2 4", "1 2 1_0 1 2 4", "row 7: found '1 2 1_0 1 2 4', expected 6 numbers"),
        ("1 2 3 1 2 4", "1 2 nan 1 2 4", "expected finite numbers"),
        ('"one"', '"one', "row 7: found a quotation mark"),
        ('second";', 'second";\nmore', "row 9: found 'more' after the semicolon"),
    ],
)
def test_tags_that_are_refused(tmp_path, old, new, message):
    recording, problems = read_content("points", tmp_path / "l.tag", TAG.replace(old, new))
    assert recording is None
    assert message in messages(problems)


END = (("F-2", [4, 5, 7]), ("F-1", [1, 3, 3]))


def pair(folder, start, end, ending=".mrk.json", frame=None):
    moved = folder / f"end{ending}"
    moved.write_text(end)
    return read_content("points", folder / f"start{ending}", start, frame, moved=moved, moved_file=moved.name)


@pytest.mark.parametrize(
    ("start", "end", "ending"),
    [
        (markup(*START), markup(*END), ".mrk.json"),
        (markup(*START, coordinateUnits=["mm", "UCUM", "millimeter"]), markup(*END), ".mrk.json"),
        (fcsv(*START), fcsv(*END, system="# CoordinateSystem = 1\n"), ".fcsv"),
    ],
)
def test_markups_are_paired_by_label(tmp_path, start, end, ending):
    points, problems = pair(tmp_path, start, end, ending, Frame("m", "RAS"))
    assert not problems, messages(problems)
    np.testing.assert_allclose(points.points, [[-0.001, -0.002, 0.003], [-0.004, -0.005, 0.006]])
    np.testing.assert_allclose(points.displacement, [[0, -0.001, 0], [0, 0, 0.001]], atol=1e-18)
    assert points.ids == ("F-1", "F-2")
    assert points.moved_file == f"end{ending}"


@pytest.mark.parametrize("system", ["# CoordinateSystem = RAS\n", "# CoordinateSystem = 0\n"])
def test_markups_in_other_axes(tmp_path, system):
    points, problems = read_content("surface", tmp_path / "s.fcsv", fcsv(*START, system=system), Frame("m", "LPS"))
    assert not problems
    np.testing.assert_allclose(points.points, [[0.001, 0.002, 0.003], [0.004, 0.005, 0.006]])
    points, problems = read_content("surface", tmp_path / "s.mrk.json", markup(*START, coordinateSystem="RAS"))
    np.testing.assert_allclose(points.points, [[0.001, 0.002, 0.003], [0.004, 0.005, 0.006]])


@pytest.mark.parametrize(
    ("start", "message"),
    [
        (markup(*START, ("F-1", [0, 0, 0])), "label 'F-1': found it 2 times"),
        (markup(*START, ("F-3", [0, 0, 0])), "label 'F-3': found no point of this label in end.mrk.json"),
        (markup(START[0]), "label 'F-2': found no point of this label in start.mrk.json"),
        (markup(START[0], ("", [4, 5, 6])), "point 2: found no label"),
        (markup(*START, coordinateUnits="um"), "coordinateUnits: found 'um', expected 'mm'"),
        (markup(*START, coordinateSystem="IJK"), "found coordinate system 'IJK'"),
        (markup(START[0], ("F-2", [1, 2])), "control point 2 'F-2': found position '[1, 2]'"),
        (markup(START[0], ("F-2", [1, 2, float("nan")])), "expected three finite numbers"),
        (markup(), "found no control points"),
        (markup(*START)[:-5], "found no valid JSON"),
        ("[]", "found no list 'markups'"),
        ('{"markups": []}', "found 0 markups, expected one"),
        (
            markup(*START).replace('"label": "F-2"', '"label": "F-2", "positionStatus": "undefined"'),
            "control point 2 'F-2': found its position 'undefined'",
        ),
    ],
)
def test_markups_that_are_refused(tmp_path, start, message):
    recording, problems = pair(tmp_path, start, markup(*END))
    assert recording is None
    assert message in messages(problems)


@pytest.mark.parametrize(
    ("start", "message"),
    [
        (fcsv(*START, system=""), "found no coordinate system"),
        (fcsv(*START, system="# CoordinateSystem = 2\n"), "found coordinate system '2'"),
        (fcsv(*START) + "3,1,2\n", "row 6: found 3 fields"),
        (fcsv(*START, ("F-3", ("a", 1, 2))), "row 6: found position 'a,1,2'"),
        (fcsv(), "found no control points"),
    ],
)
def test_old_markups_that_are_refused(tmp_path, start, message):
    recording, problems = pair(tmp_path, start, fcsv(*END), ".fcsv")
    assert recording is None
    assert message in messages(problems)


def test_one_markup_is_no_displacement(tmp_path):
    assert "not where they went" in messages(read_content("points", tmp_path / "s.mrk.json", markup(*START))[1])
    assert "expected a 3D Slicer" in messages(read("points", tmp_path / "s.mrk.json", moved=tmp_path / "e.csv")[1])
