"""Integrals above a plane, against closed forms: the formula of Hermite and Genocchi, spherical caps, polyhedra."""

import mpmath
import numpy as np
import pytest
from scipy.spatial import ConvexHull, Delaunay, HalfspaceIntersection
from shapes import box, distorted, oriented

from warpbrain.mesh import QuadraticMesh, TetMesh, integrals_above, integrals_of_shapes, integrals_on_plane
from warpbrain.mesh.surface import EDGES

RNG = np.random.default_rng(22)


def unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def divided_difference(power: int, heights: list[float]) -> mpmath.mpf:
    """Divided difference of `s_+^power / power!` in 80 digits; equal heights are moved apart by 1e-30."""
    with mpmath.workdps(80):
        knots = sorted(mpmath.mpf(h) + mpmath.mpf(10) ** -30 * i for i, h in enumerate(heights))
        table = [max(k, mpmath.mpf(0)) ** power / mpmath.factorial(power) for k in knots]
        for order in range(1, len(knots)):
            table = [(table[i + 1] - table[i]) / (knots[i + order] - knots[i]) for i in range(len(knots) - order)]
        return table[0]


def hermite_genocchi(heights: np.ndarray, volume: float, *nodes: int) -> float:
    """`int L_a L_b ... H(s) dV` over a tetrahedron, `s` linear with these heights at its corners.

    `int L_a L_b g^(3 + k)(s) dV = 6 V m g[s_0, s_1, s_2, s_3, s_a, s_b]`, `m` the product of factorials of how often a
    node stands among the k (Micchelli 1980).
    """
    repeats = np.prod([mpmath.factorial(nodes.count(node)) for node in set(nodes)])
    knots = [*heights, *(heights[node] for node in nodes)]
    return float(6.0 * volume * repeats * divided_difference(3 + len(nodes), knots))


def random_tetrahedra(count: int) -> list[TetMesh]:
    made = []
    while len(made) < count:
        corners = RNG.normal(size=(4, 3))
        if (volume := np.linalg.det(corners[1:] - corners[0])) < 0.0:
            corners[[0, 1]] = corners[[1, 0]]
        if abs(volume) > 1e-3:
            made.append(TetMesh(corners, [[0, 1, 2, 3]]))
    return made


def planes(mesh: TetMesh) -> list[tuple[np.ndarray, float]]:
    """Arbitrary planes through a tetrahedron, one through a corner, one through a face and two that miss it."""
    up = unit(RNG.normal(size=3))
    heights = mesh.points @ up
    face = unit(np.cross(mesh.points[1] - mesh.points[0], mesh.points[2] - mesh.points[0]))
    inside = RNG.uniform(heights.min(), heights.max(), 3)
    return [
        *((up, level) for level in (*inside, heights[1], heights.min() - 1.0, heights.max() + 1.0)),
        (face, float(face @ mesh.points[0])),
    ]


def test_linear_shapes_on_random_tetrahedra(verify) -> None:
    worst = 0.0
    for mesh in random_tetrahedra(40):
        for up, level in planes(mesh):
            heights = mesh.points[mesh.tetrahedra[0]] @ up - level
            expected = [hermite_genocchi(heights, mesh.volume, node) for node in range(4)]
            worst = max(worst, np.abs(integrals_above(mesh, up, level)[0] - expected).max() / mesh.volume)
    verify("load above a plane that cuts a linear tetrahedron", "formula of Hermite and Genocchi, mpmath", worst, 1e-12)


def test_quadratic_shapes_on_random_tetrahedra(verify) -> None:
    worst = 0.0
    for mesh in random_tetrahedra(15):
        nodes = QuadraticMesh(mesh)
        for up, level in planes(mesh):
            heights = nodes.points[nodes.elements[0, :4]] @ up - level

            def above(*corners: int, heights: np.ndarray = heights, volume: float = mesh.volume) -> float:
                return hermite_genocchi(heights, volume, *corners)

            expected = [2.0 * above(a, a) - above(a) for a in range(4)] + [4.0 * above(a, b) for a, b in EDGES]
            worst = max(worst, np.abs(integrals_above(nodes, up, level)[0] - expected).max() / mesh.volume)
    verify(
        "load above a plane that cuts a quadratic tetrahedron", "formula of Hermite and Genocchi, mpmath", worst, 1e-12
    )


def test_derivative_by_the_level_on_random_tetrahedra(verify) -> None:
    worst = 0.0
    for mesh in random_tetrahedra(40):
        for up, level in planes(mesh)[:3]:
            heights = mesh.points[mesh.tetrahedra[0]] @ up - level
            knots = [[*heights, heights[node]] for node in range(4)]
            expected = [float(6.0 * mesh.volume * divided_difference(3, own)) for own in knots]
            section = integrals_on_plane(mesh, up, level, lambda points: np.ones(len(points)))
            worst = max(worst, np.abs(section[0] - expected).max() / mesh.volume ** (2 / 3))
    verify("derivative of the load by the level of the plane", "formula of Hermite and Genocchi, mpmath", worst, 1e-12)


def test_levels_add_up_on_an_irregular_mesh() -> None:
    """What is above and what is below is all, whatever the elements; sections are those of the whole body."""
    mesh = distorted(box((3, 4, 3), (0.9, 1.2, 1.0)), 0.04)
    for nodes in (mesh, QuadraticMesh(mesh)):
        for up in (unit(np.array([0.3, -0.5, 0.8])), np.array([0.0, 0.0, 1.0])):
            for level in (-2.0, 0.1, 1 / 3, 0.5, 3.0):
                both = integrals_above(nodes, up, level) + integrals_above(nodes, -up, -level)
                np.testing.assert_allclose(both, integrals_of_shapes(nodes), atol=1e-15)


def ball(n: int, radius: float) -> TetMesh:
    """A cube's lattice pressed into a ball, its corner nodes on the sphere."""
    mesh = box((n, n, n), (2.0, 2.0, 2.0))
    points = mesh.points - 1.0
    length = np.linalg.norm(points, axis=1, keepdims=True)
    largest = np.abs(points).max(axis=1, keepdims=True)
    points = radius * points * largest / np.where(length > 0.0, length, 1.0)
    return TetMesh(points, mesh.tetrahedra)


def test_volume_of_a_polyhedron(verify) -> None:
    points = RNG.normal(size=(60, 3))
    mesh = oriented(points, Delaunay(points).simplices)
    hull = ConvexHull(points)
    worst = 0.0
    for level in (-0.9, -0.13, 0.0, 0.22, 1.1):
        up = unit(RNG.normal(size=3))
        highest = points[np.argmax(points @ up)]
        inside = highest + 0.5 * (1.0 - level / (highest @ up)) * (points.mean(axis=0) - highest)
        above = HalfspaceIntersection(np.vstack([hull.equations, [*-up, level]]), inside)
        expected = ConvexHull(above.intersections).volume
        worst = max(worst, abs(integrals_above(mesh, up, level).sum() - expected) / mesh.volume)
    verify("volume of a polyhedron above a plane", "SciPy: half spaces intersected", worst, 1e-12)


def test_caps_of_a_ball(verify) -> None:
    """Facets lie inside the sphere: the error falls with the second power of their size."""
    radius, up = 0.07, unit(np.array([0.2, 0.3, -1.0]))
    errors = []
    for n in (6, 12):
        mesh = ball(n, radius)
        levels = radius * np.array([-0.7, -0.2, 0.0, 0.3, 0.6])
        heights = radius - levels
        caps = np.pi * heights**2 * (3.0 * radius - heights) / 3.0
        volumes = np.array([integrals_above(mesh, up, level).sum() for level in levels])
        errors.append(np.linalg.norm(volumes - caps) / np.linalg.norm(caps))
    order = np.log2(errors[0] / errors[1])
    verify(
        "volume above a level of a ball: order in the size of facets", "spherical cap, order 2", abs(order - 2.0), 0.1
    )


@pytest.mark.parametrize("kind", [lambda mesh: mesh, QuadraticMesh], ids=["linear", "quadratic"])
def test_derivative_by_the_direction(kind) -> None:
    """A plane that turns sweeps over the tissue at a speed that is linear in the place."""
    nodes = kind(distorted(box((2, 3, 2)), 0.04))
    up, turn, level = unit(np.array([0.1, 0.4, 1.0])), np.array([0.7, -0.2, 0.3]), 0.71
    rate = integrals_on_plane(nodes, up, level, lambda points: points @ turn)
    h = 1e-4
    ends = [integrals_above(nodes, unit(up + s * h * turn), level / np.linalg.norm(up + s * h * turn)) for s in (-1, 1)]
    np.testing.assert_allclose((ends[1] - ends[0]) / (2.0 * h), rate, atol=1e-7)
