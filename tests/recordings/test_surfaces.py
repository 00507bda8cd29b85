"""Surface meshes of other programs."""

import meshio
import numpy as np
import pytest
from recording_files import messages, read
from surface_files import POINTS, QUAD, TRIANGLES, vtp

from warpbrain.frame import Frame


@pytest.mark.parametrize("ending", [".stl", ".ply", ".obj", ".vtu", ".vtk", ".off"])
def test_meshes_that_meshio_reads(tmp_path, ending):
    file = tmp_path / f"surface{ending}"
    meshio.write(file, meshio.Mesh(POINTS, [("triangle", TRIANGLES)]))
    surface, problems = read("surface", file, Frame("mm", "LPS"))
    assert not problems, messages(problems)
    corners = surface.points[surface.faces]
    np.testing.assert_allclose(corners, POINTS[TRIANGLES] * [-1e-3, -1e-3, 1e-3], atol=1e-12)
    assert surface.normals is surface.time is None


def test_cells_of_other_shapes(tmp_path):
    file = tmp_path / "quads.vtu"
    cells = [("quad", QUAD), ("line", [[0, 1]]), ("vertex", [[2]])]
    meshio.write(file, meshio.Mesh(POINTS, cells))
    surface, _ = read("surface", file)
    assert surface.faces.tolist() == TRIANGLES.tolist()
    meshio.write(file, meshio.Mesh(POINTS, [("vertex", [[0], [1], [2], [3]])]))
    cloud, _ = read("surface", file)
    assert cloud.faces is None
    assert len(cloud.points) == 4


def test_what_has_no_area_is_left_out_and_said(tmp_path):
    file = tmp_path / "surface.vtu"
    points = np.concatenate([[[99.0, 99, 99]], POINTS])
    faces = np.concatenate([TRIANGLES + 1, [[1, 1, 2], [1, 2, 2]]])
    meshio.write(file, meshio.Mesh(points, [("triangle", faces)]))
    surface, problems = read("surface", file)
    np.testing.assert_allclose(surface.points, 1e-3 * POINTS)
    assert surface.faces.tolist() == TRIANGLES.tolist()
    assert "2 of 4 faces" in problems.remarks[0]
    assert "1 of 5 points" in problems.remarks[1]


@pytest.mark.parametrize("cells", ["Polys", "Strips"])
@pytest.mark.parametrize("compressor", [None, "vtkZLibDataCompressor", "vtkLZMADataCompressor"])
@pytest.mark.parametrize(
    ("form", "encoding"), [("ascii", ""), ("binary", ""), ("appended", "base64"), ("appended", "raw")]
)
def test_vtp(tmp_path, form, encoding, compressor, cells):
    file = tmp_path / "surface.vtp"
    file.write_bytes(vtp(form, encoding, compressor, cells))
    surface, problems = read("surface", file)
    assert not problems, messages(problems)
    np.testing.assert_array_equal(surface.points, 1e-3 * POINTS)
    areas = np.cross(*(POINTS[surface.faces[:, i]] - POINTS[surface.faces[:, 0]] for i in (1, 2)))
    assert len(surface.faces) == 2
    assert (areas[:, 2] > 0).all()


def test_vtp_as_vtk_writes_it(tmp_path):
    """With pyvista where it is installed: its files are those that users have."""
    pyvista = pytest.importorskip("pyvista")
    sphere = pyvista.Sphere(theta_resolution=8, phi_resolution=8)
    for binary in (True, False):
        sphere.save(tmp_path / "sphere.vtp", binary=binary)
        surface, problems = read("surface", tmp_path / "sphere.vtp", Frame("m"))
        assert not problems
        np.testing.assert_allclose(surface.points, sphere.points, atol=1e-7)
        np.testing.assert_array_equal(surface.faces, sphere.faces.reshape(-1, 4)[:, 1:])


def test_axes_that_a_file_states_count(tmp_path):
    file = tmp_path / "surface.vtp"
    file.write_bytes(vtp("ascii", axes="LPS"))
    surface, problems = read("surface", file, Frame("mm", "RAS"))
    np.testing.assert_allclose(surface.points, POINTS * [-1e-3, -1e-3, 1e-3])
    assert "its axes are LPS" in problems.remarks[0]
    file = tmp_path / "surface.stl"
    meshio.write(file, meshio.Mesh(POINTS, [("triangle", TRIANGLES)]), binary=True)
    data = file.read_bytes()
    file.write_bytes(b"3D Slicer output. SPACE=LPS".ljust(80) + data[80:])
    surface, problems = read("surface", file, Frame("mm", "RAS"))
    np.testing.assert_allclose(surface.points.min(axis=0), [-0.01, -0.01, 0])


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("s.vtp", b"", "is empty"),
        ("s.stl", b"", "is empty"),
        ("s.vtp", b"<VTKFile", "no valid XML"),
        ("s.vtp", b'<VTKFile type="ImageData"/>', "found ImageData, expected a VTKFile of type PolyData"),
        ("s.vtp", b'<VTKFile type="PolyData"/>', "found no points"),
        ("s.vtp", b'<VTKFile type="PolyData" compressor="vtkLZ4DataCompressor"/>', "compression by vtkLZ4"),
        ("s.vtp", vtp("ascii").replace(b"10.0", b"nan"), "point 1: found a coordinate that is not finite (3 such"),
        ("s.vtp", vtp("ascii").replace(b"0 1 2 3", b"0 1 2 9"), "face 1: found a face with points"),
        ("s.vtp", vtp("appended")[:-90] + b"</AppendedData></VTKFile>", "found no surface mesh"),
        ("s.ply", b"ply\nnonsense\n", "found no surface mesh"),
        ("s.xyz", b"1 2 3\n", "found ending '.xyz'"),
    ],
)
def test_surfaces_that_are_refused(tmp_path, capsys, name, content, message):
    (tmp_path / name).write_bytes(content)
    recording, problems = read("surface", tmp_path / name)
    assert recording is None
    assert message in messages(problems)
    assert capsys.readouterr() == ("", "")


def test_volumes_are_no_surfaces(tmp_path):
    file = tmp_path / "volume.vtu"
    meshio.write(file, meshio.Mesh(POINTS, [("tetra", QUAD)]))
    assert "cells of type tetra" in messages(read("surface", file)[1])
    meshio.write(file, meshio.Mesh(POINTS, [("triangle", [[0, 0, 1]])]))
    assert "faces without area only" in messages(read("surface", file)[1])
