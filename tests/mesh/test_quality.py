"""Angles and pieces of shapes whose answers are known."""

import numpy as np
import pytest

from warpbrain.mesh import TetMesh, components, dihedral_angles, measure

REGULAR = np.array([[1.0, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]])
CORNER = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


def test_regular_tetrahedron():
    np.testing.assert_allclose(dihedral_angles(REGULAR, [[0, 1, 2, 3]]), np.degrees(np.arccos(1 / 3)))


def test_corner_of_a_cube():
    # right angles at the three edges of the corner; the slanted face makes arccos(1/sqrt(3)) with the others
    slanted = np.degrees(np.arccos(1 / np.sqrt(3)))
    np.testing.assert_allclose(dihedral_angles(CORNER, [[0, 1, 2, 3]])[0], [90, 90, 90, slanted, slanted, slanted])


@pytest.mark.parametrize("degrees", [1e-3, 1.0, 30.0, 150.0, 179.0])
def test_wedge(degrees):
    angle = np.radians(degrees)
    points = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0.5], [np.cos(angle), np.sin(angle), 0.5]])
    assert dihedral_angles(points, [[0, 1, 2, 3]])[0, 0] == pytest.approx(degrees, rel=1e-9)


def test_angles_do_not_depend_on_scale():
    tets = [[0, 1, 2, 3]]
    np.testing.assert_allclose(dihedral_angles(REGULAR * 1e-4, tets), dihedral_angles(REGULAR, tets))


def test_components_are_joined_by_faces_only():
    # tetrahedra 0 and 1 share a face, 2 touches them in one edge
    tets = [[0, 1, 2, 3], [1, 2, 3, 4], [0, 1, 5, 6]]
    assert components(tets).tolist() == [0, 0, 1]
    assert components(tets, [1, 2, 1]).tolist() == [0, 1, 2]


def test_summary():
    points = np.vstack([CORNER, [[1.0, 1, 1]]])
    quality = measure(TetMesh(points, [[0, 1, 2, 3], [1, 2, 3, 4]], [1, 2]))
    assert (quality.nodes, quality.tetrahedra, quality.inverted, quality.components) == (5, 2, 0, 1)
    assert quality.tissue_components == {1: 1, 2: 1}
    assert quality.volume == pytest.approx(0.5)
    assert quality.min_dihedral == pytest.approx(np.degrees(np.arccos(1 / np.sqrt(3))))
    assert quality.smallest_tissue_component_volume == pytest.approx(1 / 6)
    # nine edges: three of length 1, six of length sqrt(2)
    assert quality.mean_edge == pytest.approx((3 + 6 * np.sqrt(2)) / 9)
