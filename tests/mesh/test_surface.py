"""Surfaces of a box with a hole in it: areas, volumes and directions are known."""

import numpy as np
import pytest

from warpbrain.mesh import (
    TetMesh,
    boundary_faces,
    closed_surfaces,
    face_vectors,
    interface_faces,
    node_areas,
    nodes_of,
    pinched_nodes,
    split_boundary,
    tangents,
)


def box(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Cube of side n, six tetrahedra a unit cell."""
    grid = np.stack(np.meshgrid(*[np.arange(n + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    tets = []
    for path in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        steps = [cells]
        for axis in path:
            steps.append(steps[-1] + np.eye(3, dtype=int)[axis])
        nodes = np.stack([np.ravel_multi_index(tuple(s.T), (n + 1,) * 3) for s in steps], axis=1)
        odd = path in ((0, 2, 1), (1, 0, 2), (2, 1, 0))
        tets.append(nodes[:, [0, 2, 1, 3]] if odd else nodes)
    return grid.astype(float), np.concatenate(tets)


@pytest.fixture
def hollow() -> TetMesh:
    points, tets = box(5)
    middle = (np.abs(points[tets].mean(axis=1) - 2.5) < 0.5).all(axis=1)
    return TetMesh(points, tets).without(middle)[0]


def test_boundary_of_a_box():
    points, tets = box(3)
    faces = boundary_faces(tets)
    vectors = face_vectors(points, faces)
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(54)
    outward = points[faces].mean(axis=1) - 1.5
    assert (np.einsum("ij,ij->i", vectors, outward) > 0).all()
    np.testing.assert_allclose(vectors.sum(axis=0), 0, atol=1e-12)
    assert closed_surfaces(faces).tolist() == [0] * len(faces)


def test_outer_surface_and_cavity(hollow):
    outer, cavities = split_boundary(hollow.points, hollow.tetrahedra)
    assert len(cavities) == 1
    assert hollow.volume == pytest.approx(124)
    assert np.linalg.norm(face_vectors(hollow.points, outer), axis=1).sum() == pytest.approx(150)
    wall = face_vectors(hollow.points, cavities[0])
    assert np.linalg.norm(wall, axis=1).sum() == pytest.approx(6)
    # normals leave the body, so they point into the cavity
    inward = 2.5 - hollow.points[cavities[0]].mean(axis=1)
    assert (np.einsum("ij,ij->i", wall, inward) > 0).all()
    assert nodes_of(cavities[0], len(hollow.points)).sum() == 8


def test_far_from_the_origin_cavities_are_still_cavities(hollow):
    outer, cavities = split_boundary(hollow.points + 1e3, hollow.tetrahedra)
    assert (len(outer), len(cavities)) == (300, 1)


def test_node_areas_sum_to_the_area(hollow):
    outer, _ = split_boundary(hollow.points, hollow.tetrahedra)
    areas = node_areas(hollow.points, outer)
    assert areas.shape == (len(hollow.points),)
    assert areas.sum() == pytest.approx(150)
    assert (areas > 0).sum() == nodes_of(outer, len(hollow.points)).sum()


def test_interface_points_away_from_the_smaller_label():
    points, tets = box(4)
    tissue = np.where(points[tets].mean(axis=1)[:, 0] < 2, 1, 2)
    vectors = face_vectors(points, interface_faces(tets, tissue))
    np.testing.assert_allclose(vectors.sum(axis=0), [16, 0, 0], atol=1e-12)
    assert (points[np.unique(interface_faces(tets, tissue))][:, 0] == 2).all()
    assert len(interface_faces(tets, np.ones(len(tets)))) == 0


def test_three_tetrahedra_on_one_face_are_refused():
    with pytest.raises(ValueError, match="three or more"):
        boundary_faces([[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]])


def test_pinched_nodes():
    points, tets = box(2)
    assert len(pinched_nodes(boundary_faces(tets))) == 0
    cell = np.floor(points[tets].mean(axis=1)).astype(int)
    at_an_edge = (cell == (0, 0, 0)).all(axis=1) | (cell == (1, 1, 0)).all(axis=1)
    found = pinched_nodes(boundary_faces(tets[at_an_edge]))
    assert points[found].tolist() == [[1, 1, 0], [1, 1, 1]]
    at_a_corner = (cell == (0, 0, 0)).all(axis=1) | (cell == (1, 1, 1)).all(axis=1)
    assert points[pinched_nodes(boundary_faces(tets[at_a_corner]))].tolist() == [[1, 1, 1]]


@pytest.mark.parametrize("shape", [(3,), (7, 3)])
def test_tangents_are_at_right_angles_to_their_direction_and_to_each_other(shape):
    normals = np.random.default_rng(1).normal(size=shape)
    along = tangents(normals)
    assert along.shape == (*shape[:-1], 2, 3)
    np.testing.assert_allclose(np.einsum("...ki,...i->...k", along, normals), 0.0, atol=1e-14)
    gram = np.einsum("...ki,...li->...kl", along, along)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(2), gram.shape), atol=1e-14)
