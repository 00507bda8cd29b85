"""Traction on a patch: one piece of the surface, whatever else of it comes into the ball; or a force on nodes."""

import numpy as np
import pytest
from scipy.integrate import quad
from shapes import box, sphere

from warpbrain.cases.shipped import find_case
from warpbrain.mesh import QuadraticMesh, TetMesh, closed_surfaces, face_vectors, nodes_of, patch_around
from warpbrain.mesh.patches import closest_on_triangles
from warpbrain.physics.mechanism import ParameterError
from warpbrain.physics.mechanisms.traction import Traction

RADIUS = 0.015


def slab(thickness: float = 0.02, cells: int = 20) -> TetMesh:
    """60 x 60 mm."""
    return box((cells, cells, 4), (0.06, 0.06, thickness))


def pushed(mesh: TetMesh | QuadraticMesh, centre: tuple[float, float, float]) -> np.ndarray:
    """Forces of 1 Pa along z."""
    return Traction(centre=centre, value=(0.0, 0.0, -1.0), radius=RADIUS).nodal_forces(mesh)


def disc(depth: float) -> float:
    """`int w dA` over a plane at a distance from the centre [m2]."""
    reach = np.sqrt(RADIUS**2 - depth**2)
    return quad(lambda r: np.pi * r * (1.0 + np.cos(np.pi * np.hypot(r, depth) / RADIUS)), 0.0, reach, epsrel=1e-10)[0]


@pytest.mark.parametrize(
    ("height", "loaded", "elements"),
    [(0.02, 0.02, "tet4"), (0.014, 0.02, "tet4"), (0.008, 0.0, "tet4"), (-0.006, 0.0, "tet4"), (0.014, 0.02, "tet10")],
)
def test_one_side_of_a_slab_is_pressed(height, loaded, elements, verify):
    mesh = slab()
    nodes = mesh if elements == "tet4" else QuadraticMesh(mesh)
    force = pushed(nodes, (0.03, 0.03, height))
    acts = force.any(axis=1)
    assert np.abs(nodes.points[acts, 2] - loaded).max() < 1e-12
    total = disc(abs(height - loaded))
    verify(
        f"traction on one side of a slab of 20 mm in a ball of 15 mm, centre at {1e3 * height:g} mm, {elements}",
        "integral over a disc, SciPy quad",
        abs(-force[:, 2].sum() / total - 1.0),
        1e-5,
    )


@pytest.mark.parametrize("x", [0.002, 0.012, 0.03])
def test_a_thin_slab_is_pressed_on_one_side_near_its_edge_too(x):
    """Where a ball holds both sides and the edge between them."""
    mesh = slab(0.006)
    force = pushed(mesh, (x, 0.03, 0.006))
    assert force.any() and np.abs(mesh.points[force.any(axis=1), 2] - 0.006).max() < 1e-12


def test_the_other_bank_of_a_cleft_is_not_pressed():
    """Two blocks that stand on one base, 4 mm apart: the sides of the cleft face each other."""
    whole = box((16, 8, 8), (0.032, 0.016, 0.016))
    x, _, z = whole.centres.T
    mesh = whole.without((np.abs(x - 0.016) < 0.002) & (z > 0.006))[0]
    force = pushed(mesh, (0.014, 0.008, 0.012))
    acts = mesh.points[force.any(axis=1)]
    assert np.abs(acts[:, 0] - 0.014).max() < 1e-9 and acts[:, 2].min() < 0.008
    # from above both tops are: there the cleft parts them, and one is pressed
    force = pushed(mesh, (0.012, 0.008, 0.016))
    acts = mesh.points[force.any(axis=1)]
    assert acts[:, 0].max() < 0.0141 and np.abs(acts[:, 2] - 0.016).max() < 1e-9


def test_a_round_body_is_pressed_as_by_a_ball_alone():
    ball = sphere(0.06, 4)
    centre = ball.points[17] * 1.02
    near = np.linalg.norm(ball.points[ball.faces] - centre, axis=2).min(axis=1) < RADIUS
    found = patch_around(ball.points, ball.faces, centre, RADIUS)
    assert set(np.flatnonzero(near)) <= set(found.tolist())
    # those that only touch the ball in their middle besides: none of 46 here
    assert len(found) - near.sum() < 0.05 * near.sum()
    assert len(patch_around(ball.points, ball.faces, (0.0, 0.0, 0.0), 0.05)) == 0


def test_the_nearest_points_of_triangles():
    random = np.random.default_rng(0)
    corners = random.normal(size=(60, 3, 3)) + random.normal(size=(60, 1, 3))
    weights, distance = closest_on_triangles(np.zeros(3), corners)
    assert weights.min() >= -1e-12 and np.abs(weights.sum(axis=1) - 1.0).max() < 1e-12
    found = np.linalg.norm(np.einsum("kc,kci->ki", weights, corners), axis=1)
    assert distance == pytest.approx(found, rel=1e-12)
    # among many points of each triangle none is nearer, and one is nearly as near
    others = random.dirichlet((0.5, 0.5, 0.5), 4000)
    least = np.linalg.norm(np.einsum("pc,kci->kpi", others, corners), axis=2).min(axis=1)
    assert np.all(found <= least + 1e-12)
    assert np.abs(found - least).max() < 4e-3


@pytest.mark.parametrize("name", ["phantom", "0529"])
def test_a_patch_of_a_brain_is_one_piece_that_faces_one_way(name):
    mesh = find_case(name).remaining[0]
    faces, points = mesh.boundary, mesh.points
    middles = points[faces].mean(axis=1)
    normals = face_vectors(points, faces)
    more = 0
    for face in np.random.default_rng(1).choice(len(faces), 30, replace=False):
        centre = middles[face]
        found = patch_around(points, faces, centre, RADIUS)
        assert face in found
        assert closed_surfaces(faces[found]).max() == 0
        assert np.all(normals[found] @ normals[face] > 0.0)
        force = Traction(centre=tuple(centre), value=(0.0, 0.0, 1.0), radius=RADIUS).nodal_forces(mesh)
        assert not force[~nodes_of(faces[found], len(points))].any() and force.sum() > 0.0
        ball = np.linalg.norm(points[faces] - centre, axis=2).min(axis=1) < RADIUS
        more += len(np.setdiff1d(np.flatnonzero(ball), found)) > 0
    # where a ball alone would hold a wall behind
    assert more > 0


def edged() -> TetMesh:
    """A slab with the upper edge at its far end as a set without a face."""
    mesh = slab(cells=6)
    edge = (mesh.points[:, 0] > 0.06 - 1e-9) & (mesh.points[:, 2] > 0.02 - 1e-9)
    return mesh.with_node_sets({"edge": edge})


def test_nodes_share_a_force_and_carry_it_with_their_elements():
    mesh, force = edged(), np.array([0.1, 0.0, -0.5])
    hung = Traction(nodes="edge", force=tuple(force))
    hung.check(mesh)
    forces = hung.nodal_forces(mesh)
    members = mesh.node_sets["edge"]
    np.testing.assert_allclose(forces[members], np.tile(force / members.sum(), (members.sum(), 1)))
    assert not forces[~members].any()
    carried = hung.acts_on(mesh)
    assert carried.any() and members[mesh.tetrahedra[carried]].any(axis=1).all()
    assert not members[mesh.tetrahedra[~carried]].any()


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({}, "centre"),
        ({"centre": (0.0, 0.0, 0.0)}, "value"),
        ({"value": (0.0, 0.0, 1.0)}, "centre"),
        ({"force": (0.0, 0.0, 1.0)}, "nodes"),
        ({"nodes": "edge"}, "force"),
        ({"nodes": "edge", "force": (0.0, 0.0, 1.0), "radius": 0.01}, "radius"),
        ({"nodes": "edge", "force": (0.0, 0.0, 1.0), "centre": (0.0, 0.0, 0.0)}, "centre"),
        ({"centre": (0.0, 0.0, 0.0), "value": (0.0, 0.0, 1.0), "force": (0.0, 0.0, 1.0)}, "nodes"),
    ],
)
def test_it_acts_on_a_patch_or_on_nodes(given, key):
    with pytest.raises(ParameterError) as caught:
        Traction(**given)
    assert caught.value.key == key
