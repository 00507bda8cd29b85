"""Meshes that tests make: a tetrahedron, cubes, bodies swept from a triangulation, and closed surfaces."""

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import ClosedSurface

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def oriented(points: Floats, tetrahedra: Ints, tissue: Ints | None = None) -> TetMesh:
    """A mesh from tetrahedra of any orientation."""
    edges = points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]]
    flip = np.linalg.det(edges) < 0.0
    tetrahedra = tetrahedra.copy()
    tetrahedra[flip] = tetrahedra[flip][:, [0, 2, 1, 3]]
    return TetMesh(points, tetrahedra, tissue)


def tetrahedron(size: float = 1.0) -> TetMesh:
    """The corner of a cube."""
    return TetMesh(size * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), [[0, 1, 2, 3]])


def box(cells: tuple[int, int, int], lengths: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> TetMesh:
    """A box of cells, each cut into the six Kuhn tetrahedra along its main diagonal, as DOLFINx cuts its cubes."""
    axes = [np.linspace(0.0, length, n + 1) for n, length in zip(cells, lengths, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    corner = np.stack(np.meshgrid(*[np.arange(n) for n in cells], indexing="ij"), -1).reshape(-1, 3)
    stride = np.array([(cells[1] + 1) * (cells[2] + 1), cells[2] + 1, 1])
    paths = []
    for axes_in_order in permutations(range(3)):
        steps = np.vstack([np.zeros(3, int), np.cumsum(np.eye(3, dtype=int)[list(axes_in_order)], axis=0)])
        paths.append(np.stack([(corner + step) @ stride for step in steps], -1))
    return oriented(points, np.concatenate(paths))


def cube(n: int) -> TetMesh:
    """The unit cube, n x n x n cells."""
    return box((n, n, n))


def distorted(mesh: TetMesh, amount: float, tissues: int = 1, seed: int = 0) -> TetMesh:
    """The mesh with every node moved at random (the boundary too) and tissues 1 to `tissues` dealt out at random."""
    rng = np.random.default_rng(seed)
    points = mesh.points + amount * rng.uniform(-1.0, 1.0, mesh.points.shape)
    return TetMesh(points, mesh.tetrahedra, rng.integers(1, tissues + 1, len(mesh.tetrahedra)))


def disc(rings: int) -> tuple[Floats, Ints]:
    """Points in the unit disc and triangles: ring k has 6 k points."""
    points = [np.zeros((1, 2))]
    for k in range(1, rings + 1):
        angle = 2.0 * np.pi * np.arange(6 * k) / (6 * k)
        points.append(k / rings * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    triangles = []
    first = [0] + [1 + 3 * k * (k - 1) for k in range(1, rings + 1)]
    for k in range(1, rings + 1):

        def inner(i: int, k: int = k) -> int:
            return first[k - 1] + i % (6 * (k - 1)) if k > 1 else 0

        def outer(i: int, k: int = k) -> int:
            return first[k] + i % (6 * k)

        for sector in range(6):
            for i in range(k):
                triangles.append((outer(sector * k + i), outer(sector * k + i + 1), inner(sector * (k - 1) + i)))
                if i < k - 1:
                    low = sector * (k - 1) + i
                    triangles.append((inner(low), inner(low + 1), outer(sector * k + i + 1)))
    return np.concatenate(points), np.array(triangles)


def quarter(cells: int) -> tuple[Floats, Ints]:
    """A square cut into triangles; its coordinates in [0, 1] are to become angle and radius, see `swept`."""
    axis = np.linspace(0.0, 1.0, cells + 1)
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    i = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    a, b, c, d = i, i + cells + 1, i + 1, i + cells + 2
    return points, np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])


def triangle(cells: int) -> tuple[Floats, Ints]:
    """Barycentric coordinates (x, y) of a triangle cut into cells x cells triangles."""
    number = {}
    for i in range(cells + 1):
        for j in range(cells + 1 - i):
            number[i, j] = len(number)
    points = np.array(list(number)) / cells
    triangles = []
    for i, j in number:
        if i + j < cells:
            triangles.append((number[i, j], number[i + 1, j], number[i, j + 1]))
        if i + j < cells - 1:
            triangles.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    return points, np.array(triangles)


def swept(
    base: tuple[Floats, Ints], layers: int, place: Callable[[Floats, Floats], Floats], tissue: Ints | None = None
) -> TetMesh:
    """A triangulation swept through layers, each prism cut into three tetrahedra.

    `place(xy, s)` gives the points (k, 3) of base points (k, 2) in the layer at `s` in [0, 1].
    """
    xy, triangles = base
    points = np.concatenate([place(xy, np.full(len(xy), s)) for s in np.linspace(0.0, 1.0, layers + 1)])
    # a, b, c ascending: neighbours then cut their common face along the same diagonal
    a, b, c = np.sort(triangles, axis=1).T
    n = len(xy)
    prism = np.concatenate([np.stack(t, 1) for t in ((a, b, c, c + n), (a, b, b + n, c + n), (a, a + n, b + n, c + n))])
    return oriented(points, np.concatenate([prism + n * k for k in range(layers)]), tissue)


def octant(n: int, layers: int, radius: Callable[[Floats], Floats]) -> TetMesh:
    """An octant of a thick sphere; `radius` (k,) of layers at s (k,) in [0, 1]. Planes of symmetry are at exactly 0."""

    def place(xy: Floats, s: Floats) -> Floats:
        direction = np.stack([xy[:, 0], xy[:, 1], 1.0 - xy.sum(axis=1)], axis=1)
        return radius(s)[:, None] * direction / np.linalg.norm(direction, axis=1)[:, None]

    mesh = swept(triangle(n), layers, place)
    return replace(mesh, points=np.where(np.abs(mesh.points) < 1e-12, 0.0, mesh.points))


def room(size: float) -> ClosedSurface:
    """A box whose floor is at z = 0."""
    corners = np.array([[x, y, z] for x in (-size, size) for y in (-size, size) for z in (0.0, size)])
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return ClosedSurface("room", corners, np.array([q[:3] for q in quads] + [[q[0], q[2], q[3]] for q in quads]))


def sphere(radius: float, cuts: int) -> ClosedSurface:
    """An octahedron cut `cuts` times, its points on a sphere."""
    points = np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array([[a, b, c] for a in (0, 3) for b in (1, 4) for c in (2, 5)])
    turned = np.linalg.det(points[faces]) < 0.0
    faces[turned] = faces[turned][:, ::-1]
    for _ in range(cuts):
        sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
        edges, number = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
        ab, bc, ca = (len(points) + number.reshape(-1, 3)).T
        a, b, c = faces.T
        points = np.concatenate([points, points[edges].mean(axis=1)])
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        faces = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return ClosedSurface("sphere", radius * points, faces)
