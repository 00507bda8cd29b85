"""Elements cut into eight: the same body, named as before."""

import numpy as np
import pytest
from shapes import box, distorted, tetrahedron

from warpbrain.mesh import TetMesh, boundary_faces, dihedral_angles
from warpbrain.mesh.refinement import finer_mesh, refined


@pytest.mark.parametrize("mesh", [tetrahedron(), box((2, 1, 2)), distorted(box((2, 2, 2)), 0.05, tissues=2)])
def test_the_same_body(mesh: TetMesh) -> None:
    finer, ends = refined(mesh)
    assert len(finer.tetrahedra) == 8 * len(mesh.tetrahedra)
    np.testing.assert_allclose(finer.volumes.reshape(-1, 8), np.repeat(mesh.volumes[:, None] / 8.0, 8, axis=1))
    np.testing.assert_array_equal(finer.tissue.reshape(-1, 8), np.repeat(mesh.tissue[:, None], 8, axis=1))
    np.testing.assert_array_equal(finer.points[: len(mesh.points)], mesh.points)
    np.testing.assert_allclose(finer.points, mesh.points[ends].mean(axis=1))
    assert len(boundary_faces(finer.tetrahedra)) == 4 * len(boundary_faces(mesh.tetrahedra))


def test_nodes_of_cells_of_a_box_are_those_of_half_the_size() -> None:
    expected = np.unique(box((4, 4, 4)).points.round(9), axis=0)
    np.testing.assert_allclose(np.unique(refined(box((2, 2, 2)))[0].points.round(9), axis=0), expected)


def test_elements_do_not_become_worse_without_limit() -> None:
    """Kuhn's tetrahedra are cut into Kuhn's tetrahedra, again and again."""
    mesh = box((1, 1, 1))
    least = dihedral_angles(mesh.points, mesh.tetrahedra).min()
    for _ in range(3):
        mesh, _ = refined(mesh)
    assert dihedral_angles(mesh.points, mesh.tetrahedra).min() == pytest.approx(least)


def test_sets_keep_their_meaning() -> None:
    mesh = box((2, 2, 2))
    x, z = mesh.points[:, 0], mesh.points[:, 2]
    sets = {"bottom": z < 1e-9, "ends": (x < 1e-9) | (x > 1 - 1e-9), "half": z < 0.6}
    low = mesh.points[mesh.tetrahedra].mean(axis=1)[:, 2] < 0.5
    finer, _ = refined(TetMesh(mesh.points, mesh.tetrahedra, None, sets, {"low": low}))
    x, z = finer.points[:, 0], finer.points[:, 2]
    np.testing.assert_array_equal(finer.node_sets["bottom"], z < 1e-9)
    np.testing.assert_array_equal(finer.node_sets["ends"], (x < 1e-9) | (x > 1 - 1e-9))
    np.testing.assert_array_equal(finer.node_sets["half"], z < 0.6)
    np.testing.assert_array_equal(finer.element_sets["low"], np.repeat(low, 8))


def test_an_edge_through_the_body_is_not_on_its_surface() -> None:
    """The main diagonal of a cube of six tetrahedra: both ends on the surface, its middle in the centre."""
    mesh = box((1, 1, 1))
    finer, _ = refined(TetMesh(mesh.points, mesh.tetrahedra, None, {"all": np.ones(8, dtype=bool)}))
    centre = np.linalg.norm(finer.points - 0.5, axis=1) < 1e-9
    assert centre.sum() == 1
    np.testing.assert_array_equal(finer.node_sets["all"], ~centre)


def test_other_sets_of_nodes_are_inherited_on_the_same_elements() -> None:
    mesh = box((2, 2, 2))
    finer, _ = finer_mesh(mesh)
    x, z = mesh.points[:, 0], mesh.points[:, 2]
    for sets in ({"bottom": z < 1e-9}, {"ends": (x < 1e-9) | (x > 1 - 1e-9), "half": z < 0.6}):
        shared, _ = finer_mesh(mesh.with_node_sets(sets))
        anew, _ = finer_mesh(TetMesh(mesh.points, mesh.tetrahedra, mesh.tissue, sets))
        assert shared.tetrahedra is finer.tetrahedra
        assert set(shared.node_sets) == set(sets)
        for name in sets:
            np.testing.assert_array_equal(shared.node_sets[name], anew.node_sets[name])
