"""VTU files that say their axes as 3D Slicer reads them."""

import re
import subprocess
from pathlib import Path

import meshio
import numpy as np
import pytest
from mesh_axes import space_of
from shapes import box

from warpbrain.mesh import read_mesh, write_mesh
from warpbrain.mesh.vtu import axes_of_vtu, read_vtu, write_vtu

ROOT = Path(__file__).parents[2]
ROOMS = ("warpbrain", "concealed", "referee", "docs", "bench", "examples")


@pytest.mark.parametrize("axes", ["RAS", "LPS"])
def test_axes_are_said_and_the_mesh_comes_back(tmp_path, axes):
    mesh = box((2, 1, 1), (1.0, 0.5, 0.5))
    write_mesh(tmp_path / "a.vtu", mesh, axes=axes)
    assert space_of(tmp_path / "a.vtu") == axes
    assert axes_of_vtu(tmp_path / "a.vtu") == axes
    np.testing.assert_array_equal(read_mesh(tmp_path / "a.vtu").points, mesh.points)


def test_a_file_that_says_nothing(tmp_path):
    mesh = meshio.Mesh(np.eye(4, 3), [("tetra", np.array([[0, 1, 2, 3]]))])
    meshio.write(tmp_path / "a.vtu", mesh, file_format="vtu")
    assert axes_of_vtu(tmp_path / "a.vtu") is None
    np.testing.assert_array_equal(read_vtu(tmp_path / "a.vtu").points, mesh.points)


def test_other_fields_stay(tmp_path):
    mesh = meshio.Mesh(np.eye(4, 3), [("tetra", np.array([[0, 1, 2, 3]]))])
    write_vtu(tmp_path / "a.vtu", mesh)
    number = b'<DataArray type="Float64" Name="TIME" NumberOfTuples="1" format="ascii">2.5</DataArray></FieldData>'
    (tmp_path / "a.vtu").write_bytes((tmp_path / "a.vtu").read_bytes().replace(b"</FieldData>", number, 1))
    assert read_vtu(tmp_path / "a.vtu").field_data["TIME"] == pytest.approx(2.5)


def test_vtk_reads_them(tmp_path):
    vtk = pytest.importorskip("vtk")
    write_mesh(tmp_path / "a.vtu", box((1, 1, 1), (1.0, 1.0, 1.0)))
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "a.vtu"))
    reader.Update()
    array = reader.GetOutput().GetFieldData().GetAbstractArray("SPACE")
    assert isinstance(array, vtk.vtkStringArray)
    assert array.GetValue(0) == "RAS"
    assert reader.GetOutput().GetNumberOfPoints() == 8


def test_the_ways_to_meshio_that_docs_name(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    mesh = box((2, 1, 1), (1.0, 0.5, 0.5))
    points = {"displacement": np.random.default_rng(1).normal(size=mesh.points.shape)}
    cells = {"J": [np.linspace(0.9, 1.1, len(mesh.tetrahedra))]}
    path = tmp_path / "result.vtu"
    write_vtu(path, meshio.Mesh(mesh.points, [("tetra", mesh.tetrahedra)], point_data=points, cell_data=cells))
    for read in (read_vtu(path), pyvista.to_meshio(pyvista.read(path))):
        np.testing.assert_array_equal(read.points, mesh.points)
        np.testing.assert_array_equal(read.cells_dict["tetra"], mesh.tetrahedra)
        np.testing.assert_array_equal(read.point_data["displacement"], points["displacement"])
        np.testing.assert_array_equal(read.cell_data["J"][0], cells["J"][0])


def test_every_file_of_vtk_in_the_repository_says_its_axes():
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout.split()
    found = [ROOT / name for name in listed if name.endswith(".vtu")] or list((ROOT / "warpbrain").rglob("*.vtu"))
    assert len(found) > 20
    for path in found:
        assert axes_of_vtu(path) == "RAS", path


def test_there_is_one_writer():
    """Whatever else wrote a file of VTK would write one that does not say its axes."""
    others = re.compile(
        r"\bmeshio\.write\(|\bmeshio\.Mesh\([^)]*\)\.write\(|\bXML\w*Writer\b|\bvtk\w*Writer\b|\bsave_meshio\b"
    )
    places = [path for room in ROOMS for path in (ROOT / room).rglob("*.py")]
    found = {path.relative_to(ROOT).as_posix() for path in places if others.search(path.read_text(encoding="utf-8"))}
    assert found == {"warpbrain/mesh/vtu.py"}
    # PyVista's meshes have a method of their own: nothing that is drawn is kept as a mesh
    drawing = [path for path in places if "pyvista" in path.read_text(encoding="utf-8")]
    assert drawing
    for path in drawing:
        assert not re.search(r"(?<!np)\.save\(", path.read_text(encoding="utf-8")), path
