"""Recordings of all kinds from CSV: units, axes, optional columns, and what is refused."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from recording_files import messages, read, read_content

from warpbrain import recordings
from warpbrain.frame import Frame


def test_points(tmp_path):
    content = (
        "id,x,y,z,ux,uy,uz,t,sigma,weight\na,10,20,30,1,2,3,0,0.5,1\nb,0,0,0,4,5,6,0,1,0\na,10,20,30,2,3,4,1,.5,2\n"
    )
    points, problems = read_content("points", tmp_path / "p.csv", content, Frame("mm", "LPS"), sigma=1.0)
    assert not problems
    np.testing.assert_allclose(points.points[0], [-0.01, -0.02, 0.03])
    np.testing.assert_allclose(points.displacement[1], [-0.004, -0.005, 0.006])
    np.testing.assert_allclose(points.sigmas, [0.0005, 0.001, 0.0005])
    assert points.ids == ("a", "b", "a")
    assert points.time.tolist() == [0, 0, 1]
    assert points.weights.tolist() == [1, 0, 2]
    assert (points.sigma, points.outside, points.role, points.file) == (0.001, "error", "fit", "p.csv")


def test_points_without_anything_optional(tmp_path):
    points, problems = read_content("points", tmp_path / "p.csv", "x,y,z,ux,uy,uz\n1,2,3,0,0,1\n", Frame("m"))
    assert not problems
    np.testing.assert_array_equal(points.points, [[1, 2, 3]])
    assert points.time is points.ids is points.sigmas is points.weights is None


HEAD = "x,y,z,ux,uy,uz"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x,y,z,ux,uy\n1,2,3,4,5\n", "header: found no column 'uz'"),
        (HEAD + ",sigma\n1,2,3,4,5,6,0\n", "row 2, column sigma: found 0, expected more than 0"),
        (HEAD + ",weight\n1,2,3,4,5,6,-1\n", "row 2, column weight: found -1, expected 0 or more"),
        (HEAD + ",id\n1,2,3,4,5,6,a\n1,2,3,4,5,6,a\n", "row 3, column id: found 'a' again (row 2)"),
        (HEAD + ",id\n1,2,3,4,5,6,\n", "row 2, column id: found nothing"),
        (HEAD + ",t\n1,2,3,4,5,6,1\n1,2,3,4,5,6,0\n", "found 0 s after 1 s (row 2)"),
        (HEAD + ",t,id\n1,2,3,4,5,6,1,a\n1,2,3,4,5,6,1,a\n", "of 'a', expected a later time"),
    ],
)
def test_points_that_are_refused(tmp_path, content, message):
    recording, problems = read_content("points", tmp_path / "p.csv", content)
    assert recording is None
    assert len(problems.found) == 1
    assert message in messages(problems)


def test_no_other_file_where_one_holds_all(tmp_path):
    content = HEAD + "\n1,2,3,4,5,6\n"
    assert "markups" in messages(read_content("points", tmp_path / "p.csv", content, moved=tmp_path / "q.csv")[1])
    assert "ending '.xlsx'" in messages(read("points", tmp_path / "p.xlsx")[1])
    assert "ending '.txt'" in messages(read("force", tmp_path / "p.txt")[1])


def test_surface(tmp_path):
    content = "x,y,z,nx,ny,nz,t\n1,2,3,0,0,2,0\n4,5,6,3,4,0,0\n"
    surface, problems = read_content("surface", tmp_path / "s.csv", content, Frame("mm", "LPS"))
    assert not problems
    np.testing.assert_allclose(surface.points, [[-0.001, -0.002, 0.003], [-0.004, -0.005, 0.006]])
    np.testing.assert_allclose(surface.normals, [[0, 0, 1], [-0.6, -0.8, 0]])
    assert surface.nodes == "cavity"
    assert surface.faces is None


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x,y,z,nx\n1,2,3,4\n", "found no column 'ny'"),
        ("x,y,z,nx,ny,nz\n1,2,3,0,0,0\n", "a normal of length zero"),
        ("x,y\n1,2\n", "found no column 'z'"),
        ("x,y,z,t\n1,2,3,1\n1,2,3,0\n", "expected no earlier time"),
    ],
)
def test_surfaces_that_are_refused(tmp_path, content, message):
    recording, problems = read_content("surface", tmp_path / "s.csv", content)
    assert recording is None
    assert message in messages(problems)


def test_force(tmp_path):
    force, problems = read_content(
        "force", tmp_path / "f.csv", "t,fx,fz,torque\n0,1,2,3\n1,4,5,6\n", Frame("mm", "LPS")
    )
    assert not problems
    np.testing.assert_array_equal(force.force, [[-1, np.nan, 2], [-4, np.nan, 5]])
    np.testing.assert_array_equal(force.torque, [3, 6])
    assert force.boundary == "grip"
    only, _ = read_content("force", tmp_path / "f.csv", "t,torque\n0,3\n")
    assert np.isnan(only.force).all()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("fx\n1\n", "found no column 't'"),
        ("t\n1\n", "found no column 'fx'"),
        ("t,fx\n0,1\n0,2\n", "expected a later time"),
        ("t,fx\n0,nan\n", "expected a finite number"),
    ],
)
def test_forces_that_are_refused(tmp_path, content, message):
    recording, problems = read_content("force", tmp_path / "f.csv", content)
    assert recording is None
    assert message in messages(problems)


@pytest.mark.parametrize(
    ("mode", "content", "quantities", "imposed"),
    [
        ("axial", "t,displacement,force\n0,0,0\n1,-2,-3\n", ("displacement", "force"), [0, -0.002]),
        ("axial", "stretch,stress\n1,0\n0.9,-3\n", ("stretch", "stress"), [1, 0.9]),
        ("shear", "displacement,force\n0,0\n1,2\n", ("displacement", "force"), [0, 0.001]),
        ("torsion", "angle,torque\n0,0\n0.1,2\n", ("angle", "torque"), [0, 0.1]),
    ],
)
def test_tests(tmp_path, mode, content, quantities, imposed):
    recording, problems = read_content("test", tmp_path / "t.csv", content, mode=mode)
    assert not problems
    assert recording.quantities == quantities
    np.testing.assert_allclose(recording.imposed, imposed)
    assert recording.mode == mode


@pytest.mark.parametrize(
    ("mode", "content", "message"),
    [
        ("axial", "displacement,stress\n0,0\n", "found no column"),
        ("axial", "displacement,force,stretch,stress\n0,0,1,0\n", "expected one pair"),
        ("axial", "stretch,stress\n0,0\n", "found 0, expected more than 0"),
        ("shear", "stretch,stress\n1,0\n", "found no column 'displacement'"),
        ("torsion", "angle,force\n1,0\n", "found no column 'torque'"),
        ("axial", "t,displacement,force\n1,0,0\n1,1,1\n", "expected a later time"),
    ],
)
def test_tests_that_are_refused(tmp_path, mode, content, message):
    recording, problems = read_content("test", tmp_path / "t.csv", content, mode=mode)
    assert recording is None
    assert message in messages(problems)


def test_nothing_heavy_is_imported_before_there_is_work():
    modules = [f"warpbrain.recordings.{file.stem}" for file in Path(recordings.__path__[0]).glob("*.py")]
    code = f"import sys, {', '.join(modules)}; print([m for m in ('scipy', 'meshio', 'warp') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "[]\n"
