"""Meshes on disk: what is written comes back, what is wrong is named."""

import meshio
import numpy as np
import pytest
from shapes import box

from warpbrain.mesh import MeshError, TetMesh, read_mesh, write_mesh
from warpbrain.mesh.vtu import read_vtu

POINTS = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1], [0.1, 0.1, 0.1]])
TETS = np.array([[0, 1, 2, 3], [1, 2, 3, 4]])


def sample() -> TetMesh:
    low, first = POINTS[:, 2] == 0, np.array([True, False])
    return TetMesh(POINTS, TETS, [3, 7], {"low": low}, {"first": first})


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_round_trip(tmp_path, unit):
    path = tmp_path / "a.vtu"
    write_mesh(path, sample(), unit=unit)
    mesh = read_mesh(path, unit=unit)
    np.testing.assert_allclose(mesh.points, POINTS, rtol=1e-15)
    np.testing.assert_array_equal(mesh.tetrahedra, TETS)
    assert mesh.tissue.tolist() == [3, 7]
    assert {k: v.tolist() for k, v in mesh.node_sets.items()} == {"low": [True, True, True, False, False]}
    assert {k: v.tolist() for k, v in mesh.element_sets.items()} == {"first": [True, False]}
    assert [p.name for p in tmp_path.iterdir()] == ["a.vtu"]


def test_unit_of_the_file(tmp_path):
    write_mesh(tmp_path / "a.vtu", sample(), unit="mm")
    assert read_vtu(tmp_path / "a.vtu").points.max() == pytest.approx(100)


def test_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "a.vtu"
    write_mesh(path, sample())
    before = path.read_bytes()
    monkeypatch.setattr(meshio, "write", lambda *args, **kwargs: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        write_mesh(path, sample())
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("ending", ["vtk", "msh", "inp", "xdmf", "mesh"])
def test_other_formats(tmp_path, ending):
    if ending == "xdmf":
        pytest.importorskip("h5py")
    path = tmp_path / f"a.{ending}"
    raw = meshio.Mesh(POINTS, [("triangle", TETS[:1, :3]), ("tetra", TETS[:1]), ("tetra", TETS[1:])])
    meshio.write(path, raw)
    mesh = read_mesh(path)
    np.testing.assert_allclose(mesh.points, POINTS)
    np.testing.assert_array_equal(mesh.tetrahedra, TETS)
    assert mesh.tissue.tolist() == [1, 1]


def test_real_valued_arrays_are_not_sets(tmp_path):
    raw = meshio.Mesh(
        POINTS,
        [("tetra", TETS)],
        point_data={"t1": np.linspace(0, 1, 5), "cap": np.array([0, 2, 0, 1, 0])},
        cell_data={"region": [np.array([1, 2])], "set_b": [np.array([0, 5])]},
    )
    meshio.write(tmp_path / "a.vtu", raw)
    mesh = read_mesh(tmp_path / "a.vtu", tissue="region")
    assert {k: v.tolist() for k, v in mesh.node_sets.items()} == {"cap": [False, True, False, True, False]}
    assert {k: v.tolist() for k, v in mesh.element_sets.items()} == {"b": [False, True]}
    assert mesh.tissue.tolist() == [1, 2]


def test_a_set_of_real_zeros_and_ones(tmp_path):
    cap = np.array([0.0, 1.0, 0.0, 1.0, 0.0])
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(POINTS, [("tetra", TETS)], point_data={"cap": cap}))
    assert read_mesh(tmp_path / "a.vtu").node_sets["cap"].tolist() == [False, True, False, True, False]
    cap[2] = np.nan
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(POINTS, [("tetra", TETS)], point_data={"cap": cap}))
    with pytest.raises(MeshError, match="'cap' holds 1 values that are not finite"):
        read_mesh(tmp_path / "a.vtu")


def test_errors_name_the_file(tmp_path):
    with pytest.raises(MeshError, match=r"gone\.vtu: no such file"):
        read_mesh(tmp_path / "gone.vtu")
    junk = tmp_path / "junk.vtu"
    junk.write_text("not a mesh")
    with pytest.raises(MeshError, match=r"junk\.vtu: not a mesh that meshio can read"):
        read_mesh(junk)
    strange = tmp_path / "mesh.strange"
    strange.write_text("")
    with pytest.raises(MeshError, match=r"mesh\.strange: not a mesh"):
        read_mesh(strange)


def test_errors_say_what_was_found(tmp_path):
    path = tmp_path / "a.vtu"
    meshio.write(path, meshio.Mesh(POINTS, [("triangle", TETS[:, :3])]))
    with pytest.raises(MeshError, match=r"a\.vtu: found no tetrahedra \(cells: triangle\)"):
        read_mesh(path)
    meshio.write(path, meshio.Mesh(POINTS, [("tetra", TETS), ("pyramid", [[0, 1, 2, 3, 4]])]))
    with pytest.raises(MeshError, match="found volume cells of type pyramid"):
        read_mesh(path)
    meshio.write(path, meshio.Mesh(POINTS, [("tetra", TETS[:, [1, 0, 2, 3]])]))
    with pytest.raises(MeshError, match=r"a\.vtu: 2 tetrahedra are inverted"):
        read_mesh(path)
    meshio.write(path, meshio.Mesh(POINTS, [("tetra", TETS)]))
    with pytest.raises(MeshError, match="no cell array 'region'"):
        read_mesh(path, tissue="region")
    with pytest.raises(MeshError, match="unit must be one of m, mm, found 'cm'"):
        read_mesh(path, unit="cm")
    with pytest.raises(MeshError, match=r"written as \.vtu"):
        write_mesh(tmp_path / "a.vtk", sample())


@pytest.mark.parametrize("ending", ["bdf", "ele", "dat"])
def test_a_reader_that_would_wait_for_ever_is_stopped(tmp_path, monkeypatch, ending):
    """meshio's readers of these formats look for the end of a file that is cut off until somebody ends them."""
    monkeypatch.setattr("warpbrain.mesh.patience.SECONDS", 0.5)
    path = tmp_path / f"mesh.{ending}"
    content = {"bdf": "BEGIN BULK\nGRID,1,,0.0,0.0,0.0\n", "ele": "", "dat": 'VARIABLES = "X"'}[ending]
    path.write_text(content or "# cut off\n")
    (tmp_path / "mesh.node").write_text("# cut off\n")
    with pytest.raises(MeshError, match=f"mesh.{ending}: not a mesh that meshio can read"):
        read_mesh(path)


def test_xdmf(tmp_path):
    mesh = box((2, 2, 2), (1.0, 1.0, 1.0))
    raw = meshio.Mesh(mesh.points, [("tetra", mesh.tetrahedra)], point_data={"low": (mesh.points[:, 2] == 0.0) * 1})
    meshio.write(tmp_path / "mesh.xdmf", raw)
    read = read_mesh(tmp_path / "mesh.xdmf")
    np.testing.assert_allclose(read.points, mesh.points)
    np.testing.assert_array_equal(read.node_sets["low"], mesh.points[:, 2] == 0.0)


def test_sets_of_abaqus(tmp_path):
    mesh = box((1, 1, 1), (1.0, 1.0, 1.0))
    raw = meshio.Mesh(mesh.points, [("tetra", mesh.tetrahedra)], point_sets={"LOW": [0, 2, 3]})
    meshio.write(tmp_path / "mesh.inp", raw)
    assert np.flatnonzero(read_mesh(tmp_path / "mesh.inp").node_sets["LOW"]).tolist() == [0, 2, 3]
