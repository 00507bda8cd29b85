"""The wall that is left where tetrahedra are taken out: its triangles, and none of the surface beside it."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from shapes import cube, distorted

from warpbrain.mesh import (
    TetMesh,
    face_vectors,
    faces_of,
    interface_faces,
    rim_edges,
    split_boundary,
    wall_nodes,
)
from warpbrain.mesh.refinement import finer_mesh


def opened(seed: int) -> tuple[TetMesh, TetMesh, np.ndarray]:
    """A cube with a ragged part as an element set, what is left without it, and its wall in nodes of what is left."""
    mesh = distorted(cube(4), 0.02)
    away = np.linalg.norm(mesh.centres - [0.5, 0.5, 1.0], axis=1)
    ragged = away + np.random.default_rng(seed).uniform(-0.2, 0.2, len(away)) < 0.4
    mesh = replace(mesh, element_sets={"part": ragged})
    mesh = mesh.with_node_sets({"part": wall_nodes(mesh, "part")})
    left, nodes, _ = mesh.without(ragged)
    number = np.full(len(mesh.points), -1)
    number[nodes] = np.arange(len(nodes))
    return mesh, left, number[interface_faces(mesh.tetrahedra, ragged)]


def as_set(faces: np.ndarray) -> set[tuple[int, ...]]:
    """Triangles with their orientation, whatever node comes first."""
    return {tuple(np.roll(face, -int(np.argmin(face))).tolist()) for face in faces}


@pytest.mark.parametrize("seed", range(4))
def test_nodes_of_a_wall_hold_its_triangles_and_none_beside_it(seed):
    _, left, wall = opened(seed)
    members = left.node_sets["part"]
    beside = left.boundary[members[left.boundary].all(axis=1)]
    # the surface has triangles with three nodes on the rim, which a rule by nodes alone would take
    assert len(beside) > len(wall)
    assert as_set(faces_of(left, members)) == as_set(wall) == as_set(left.cut)
    # with a node that is none of the wall's it is a set as any other
    more = members.copy()
    more[np.setdiff1d(left.boundary, left.cut)[0]] = True
    assert as_set(faces_of(left, more)) >= as_set(beside)


def test_a_wall_stays_one_through_copies_cuts_and_refinement():
    mesh, left, wall = opened(0)
    assert not len(mesh.cut)
    for other in (replace(left, node_sets={}), left.with_node_sets({}), pickle.loads(pickle.dumps(left))):
        assert as_set(other.cut) == as_set(wall)
    finer = finer_mesh(left)[0]
    assert len(finer.cut) == 4 * len(wall)
    assert as_set(faces_of(finer, finer.node_sets["part"])) == as_set(finer.cut)
    total, fine = (face_vectors(m.points, m.cut).sum(axis=0) for m in (left, finer))
    np.testing.assert_allclose(fine, total, atol=1e-14)
    # a second cut keeps what is left of the first
    below = left.centres[:, 2] < 0.7
    again, nodes, _ = left.without(below)
    boundary = as_set(again.boundary)
    assert as_set(again.cut) <= boundary
    first = {face for face in as_set(left.cut) if set(face) <= set(nodes.tolist())}
    kept = {tuple(nodes[list(face)].tolist()) for face in as_set(again.cut)}
    between = as_set(interface_faces(left.tetrahedra, below))
    assert as_set(np.array(sorted(kept))) - between <= first


@pytest.mark.parametrize("seed", range(4))
def test_a_rim_is_where_an_oriented_surface_ends(seed):
    mesh, left, wall = opened(seed)
    # closed, even where it touches itself along an edge
    assert len(rim_edges(left.boundary)) == 0 == len(rim_edges(split_boundary(mesh.points, mesh.tetrahedra)[0]))
    rim = rim_edges(wall)
    outer = as_set(left.boundary) - as_set(wall)
    np.testing.assert_array_equal(rim, rim_edges(np.array(sorted(outer))))
    assert len(rim) > 0
