"""The build: its parts on shapes with known answers, and the whole against the shipped files."""

import json
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from drawn_for_commit import one_for_this_commit

pytest.importorskip("scipy")

from scipy.spatial import cKDTree

from warpbrain.cases.building.cleaning import open_angles
from warpbrain.cases.building.lattice import bcc_lattice, cut
from warpbrain.cases.building.mmg import Cells, Size
from warpbrain.cases.building.pipeline import NAMES, build
from warpbrain.cases.building.template import anterior_temporal_lobe, individual
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh, boundary_faces, dihedral_angles, pinched_nodes, read_mesh, split_boundary
from warpbrain.mesh.tet_mesh import signed_volumes

ZERO, TWO = np.zeros(3), np.full(3, 2.0)


def lattice(spacing: float) -> Cells:
    points, tets = bcc_lattice(ZERO, TWO, spacing)
    return Cells(points, tets, np.ones(len(tets), dtype=np.int64))


def sphere(radius: float):
    return lambda points: radius - np.linalg.norm(points - 1.0, axis=1)


def test_what_runs_mmg_loads_nothing_else():
    """It is a process for each of dozens of tries at a mesh."""
    code = "import sys, warpbrain.cases.building.mmg; print({'scipy', 'meshio', 'warp'} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"


def test_lattice_is_regular():
    points, tets = bcc_lattice(ZERO, TWO, 0.5)
    np.testing.assert_allclose(signed_volumes(points, tets), 0.5**3 / 12)
    np.testing.assert_allclose(np.sort(dihedral_angles(points, tets)), np.tile([60.0] * 4 + [90.0] * 2, (len(tets), 1)))
    assert len(pinched_nodes(boundary_faces(lattice(0.5).compact().tetrahedra))) == 0


def test_cut_finds_the_surface_and_keeps_the_volume():
    points, tets = bcc_lattice(ZERO, TWO, 0.2)
    whole = signed_volumes(points, tets).sum()
    made, inside = cut(Cells(points, tets, np.arange(len(tets))), sphere(0.6))
    volumes = signed_volumes(made.points, made.tetrahedra)
    assert (volumes > 0).all()
    assert volumes.sum() == pytest.approx(whole)
    assert made.labels.max() < len(tets)
    ball = made.part(inside).compact()
    # discretisation: flat faces in edges of 0.2, for a radius of 0.6, leave out 3.6 %
    assert volumes[inside].sum() == pytest.approx(4 / 3 * np.pi * 0.6**3, rel=0.05)
    surface = np.unique(boundary_faces(ball.tetrahedra))
    # nodes lie on the sphere, but for those that were so near that they were taken to be on it
    np.testing.assert_allclose(np.linalg.norm(ball.points[surface] - 1, axis=1), 0.6, atol=0.2 * 0.07)


def test_cut_conforms():
    whole = lattice(0.25)
    made, inside = cut(whole, sphere(0.5))
    # a face that does not meet its neighbour would be boundary
    assert len(boundary_faces(made.tetrahedra)) == len(boundary_faces(whole.tetrahedra))
    assert len(split_boundary(made.points, made.tetrahedra[~inside])[1]) == 1


def test_cut_that_meets_nothing_changes_nothing():
    whole = lattice(0.5)
    made, inside = cut(whole, sphere(9.0))
    np.testing.assert_array_equal(made.points, whole.points)
    np.testing.assert_array_equal(made.tetrahedra, whole.tetrahedra)
    assert inside.all()


def test_open_angles_opens_them_and_keeps_the_shape():
    made, inside = cut(lattice(0.3), sphere(0.7))
    before = made.part(inside).compact()
    points, tets = before.points, before.tetrahedra
    assert dihedral_angles(points, tets).min() < 10
    after = open_angles(before, 20.0)
    assert dihedral_angles(after.points, tets).min() > 2 * dihedral_angles(points, tets).min()
    assert (signed_volumes(after.points, tets) > 0).all()
    assert signed_volumes(after.points, tets).sum() == pytest.approx(signed_volumes(points, tets).sum(), rel=1e-3)


def test_individual_warp_is_smooth_repeatable_and_invertible():
    points = np.random.default_rng(0).uniform(-80, 80, (500, 3))
    moved = individual(points, 7, 3.0)
    np.testing.assert_array_equal(moved, individual(points, 7, 3.0))
    assert not np.allclose(moved, individual(points, 8, 3.0))
    shift = np.linalg.norm(moved - points, axis=1)
    assert 1.0 < np.sqrt((shift**2).mean()) < 6.0
    step = 1e-3
    gradient = np.stack([(individual(points + step * e, 7, 3.0) - moved) / step for e in np.eye(3)], axis=-1)
    determinant = np.linalg.det(gradient)
    assert determinant.min() > 0.5 and determinant.max() < 1.8


def test_resection_sides_mirror_each_other():
    points = np.random.default_rng(0).uniform(-80, 80, (50, 3))
    mirrored = points * [-1, 1, 1]
    np.testing.assert_array_equal(anterior_temporal_lobe(points, "left"), anterior_temporal_lobe(mirrored, "right"))
    pole = np.array([[-42.0, 14.0, -34.0]])
    assert anterior_temporal_lobe(pole, "left")[0] > 0 > anterior_temporal_lobe(pole, "right")[0]


def test_size_counts_what_it_says():
    cells = lattice(1.0)
    assert Size("nodes", 1, 2).count(cells) == len(cells.points)
    assert Size("tetrahedra", 1, 2).count(cells) == len(cells.tetrahedra)


def test_unknown_case_is_named():
    with pytest.raises(InputError, match="no case 'nobody' can be built; choose from phantom, 0529"):
        build("nobody", "unused")


def test_missing_extra_is_named(monkeypatch, tmp_path):
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"mmgpy, nilearn, nibabel.*warpbrain\[build\]"):
        build("phantom", tmp_path)
    assert not list(tmp_path.iterdir())


def test_every_clinical_case_can_be_built():
    assert NAMES == ("phantom", "0529", "0614", "0660", "0685", "0535", "0555", "0603", "0684")


# the others take minutes each and differ by side and seed alone; one of the other side is made again, to the bit and
# finer, by tests/concealed/test_stand_ins.py: by the same process, which has smoothed the template then
@pytest.mark.slow(90)
@pytest.mark.xdist_group("building")
@pytest.mark.parametrize("name", one_for_this_commit(["phantom", "0529"]))
def test_building_again_gives_the_shipped_meshes(name, tmp_path, monkeypatch):
    """One of the first two: the phantom's finer meshes are looked for in the same way."""
    for package in ("mmgpy", "nilearn", "nibabel"):
        pytest.importorskip(package)
    from warpbrain.cases.building.pipeline import RECIPES, versions

    shipped = files("warpbrain") / "cases" / "data" / name
    record = json.loads((shipped / "meshes.json").read_text(encoding="utf-8"))
    if record["versions"] != versions():
        pytest.skip(f"shipped meshes were made with {record['versions']}, here are {versions()}")
    monkeypatch.setitem(RECIPES, name, replace(RECIPES[name], meshes=RECIPES[name].meshes[:2]))
    folder = build(name, tmp_path)
    for file in json.loads((folder / "meshes.json").read_text(encoding="utf-8"))["meshes"]:
        made, kept = (read_mesh(str(place / f"{file}.vtu"), unit="mm") for place in (folder, shipped))
        assert_same_but_for_numbering(made, kept)


def assert_same_but_for_numbering(made: TetMesh, kept: TetMesh):
    """Nodes of equal degree are ordered as `numpy.argsort` leaves them, which differs between processors."""
    distances, node = cKDTree(kept.points).query(made.points)
    np.testing.assert_allclose(distances, 0, atol=1e-9)
    np.testing.assert_array_equal(np.sort(node), np.arange(len(kept.points)))
    for key, members in kept.node_sets.items():
        np.testing.assert_array_equal(made.node_sets[key], members[node])
    corners = [np.sort(tetrahedra, axis=1) for tetrahedra in (node[made.tetrahedra], kept.tetrahedra)]
    by_corners = [np.lexsort(each.T) for each in corners]
    np.testing.assert_array_equal(corners[0][by_corners[0]], corners[1][by_corners[1]])
    np.testing.assert_array_equal(made.tissue[by_corners[0]], kept.tissue[by_corners[1]])
    for key, members in kept.element_sets.items():
        np.testing.assert_array_equal(made.element_sets[key][by_corners[0]], members[by_corners[1]])
