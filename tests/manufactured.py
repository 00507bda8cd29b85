"""A solution that is chosen, and what it takes to measure how far a computed one is from it."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_jacobi

from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material

Floats = NDArray[np.float64]
MATERIAL = Material(NeoHookean(1.0), 0.45, "uncoupled")
pi = np.pi


def exact(X: Floats) -> Floats:
    """`u = 0.1 (sin(pi x) y (1 + z), sin(pi y) z (1 + x), sin(pi z) x (1 + y))` at points (..., 3)."""
    x, y, z = (X[..., i] for i in range(3))
    return 0.1 * np.stack(
        [np.sin(pi * x) * y * (1 + z), np.sin(pi * y) * z * (1 + x), np.sin(pi * z) * x * (1 + y)], -1
    )


def exact_gradient(X: Floats) -> Floats:
    x, y, z = (X[..., i] for i in range(3))
    s, c = (lambda v: np.sin(pi * v)), (lambda v: pi * np.cos(pi * v))
    rows = [
        [c(x) * y * (1 + z), s(x) * (1 + z), s(x) * y],
        [s(y) * z, c(y) * z * (1 + x), s(y) * (1 + x)],
        [s(z) * (1 + y), s(z) * x, c(z) * x * (1 + y)],
    ]
    return 0.1 * np.stack([np.stack(row, -1) for row in rows], -2)


def quadrature(points: int) -> tuple[Floats, Floats]:
    """Barycentric points and weights (summing to one) of a tetrahedron, exact for degree `2 points - 1` (Stroud)."""
    rules = [roots_jacobi(points, k, 0) for k in range(3)]
    (a, wa), (b, wb), (c, wc) = [((x + 1.0) / 2.0, w / w.sum()) for x, w in rules]
    C, B, A = np.meshgrid(c, b, a, indexing="ij")
    weights = np.einsum("i,j,k->ijk", wc, wb, wa).ravel()
    z, y, x = C, B * (1.0 - C), A * (1.0 - B) * (1.0 - C)
    bary = np.stack([x, y, z, 1.0 - x - y - z], -1).reshape(-1, 4)
    return bary, weights


def gradients(points: Floats, tetrahedra: NDArray[np.integer]) -> Floats:
    """Gradients of the four linear shape functions of each element (m, 4), of any orientation, shape (m, 4, 3)."""
    edges = points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]]
    inverse = np.linalg.inv(edges.transpose(0, 2, 1))
    return np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)


def norm(mesh: TetMesh, weights: Floats, values: Floats) -> float:
    """L2 norm over a mesh of values (m, q, ...) at quadrature points of weights (q,)."""
    squares = (values**2).reshape(*values.shape[:2], -1).sum(-1)
    return float(np.sqrt(np.einsum("e,q,eq->", mesh.volumes, weights, squares)))
