"""B4: a manufactured solution. Rates of convergence, and the errors that DOLFINx makes on the same meshes."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from bodies import model_of
from material_point import stress_at
from numpy.typing import NDArray
from scipy.special import roots_jacobi
from shapes import cube

from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.load import Load
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]
NUMBERS = json.loads((Path(__file__).parent / "data" / "manufactured.json").read_text())
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


def gradients(mesh: TetMesh) -> Floats:
    """Gradients of the four shape functions of each element, shape (m, 4, 3)."""
    edges = mesh.points[mesh.tetrahedra[:, 1:]] - mesh.points[mesh.tetrahedra[:, :1]]
    inverse = np.linalg.inv(edges.transpose(0, 2, 1))
    return np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)


@dataclass(frozen=True, kw_only=True)
class ManufacturedLoad(Load):
    """The body force of `u`, by its weak form `(P(grad u), grad v)`."""

    device: str
    sentence: ClassVar[str] = "Forces that hold the manufactured solution."

    def nodal_forces(self, mesh: TetMesh) -> Floats:
        bary, weights = quadrature(3)
        X = np.einsum("qa,eai->eqi", bary, mesh.points[mesh.tetrahedra])
        F = np.eye(3) + exact_gradient(X)
        P = stress_at(MATERIAL, F.reshape(-1, 3, 3), self.device).reshape(F.shape)
        mean = np.einsum("q,eqij->eij", weights, P)
        element = np.einsum("e,eij,eaj->eai", mesh.volumes, mean, gradients(mesh))
        forces = np.zeros(mesh.points.shape)
        np.add.at(forces, mesh.tetrahedra, element)
        return forces


@cache
def errors(n: int, device: str) -> tuple[float, float]:
    """L2 norms of the error and of its gradient."""
    mesh = cube(n)
    boundary = np.any((mesh.points < 1e-12) | (mesh.points > 1.0 - 1e-12), axis=1)
    constrained = np.repeat(boundary[:, None], 3, axis=1)
    prescribed = np.where(constrained, exact(mesh.points), 0.0)
    load = ManufacturedLoad(device=device)
    model = model_of(mesh, MATERIAL, constrained=constrained, prescribed=prescribed, loads=[load])
    u = solve_equilibrium(System(model, device), EquilibriumOptions(tolerance=1e-9)).u
    bary, weights = quadrature(4)
    X = np.einsum("qa,eai->eqi", bary, mesh.points[mesh.tetrahedra])
    difference = np.einsum("qa,eai->eqi", bary, u[mesh.tetrahedra]) - exact(X)
    slope = np.einsum("eai,eaj->eij", u[mesh.tetrahedra], gradients(mesh))[:, None] - exact_gradient(X)

    def norm(values: Floats) -> float:
        squares = (values**2).reshape(*values.shape[:2], -1).sum(-1)
        return float(np.sqrt(np.einsum("e,q,eq->", mesh.volumes, weights, squares)))

    return norm(difference), norm(slope)


def test_quadrature() -> None:
    """`x^2 y z^2` over the unit tetrahedron: 2! 1! 2! / 8!."""
    bary, weights = quadrature(3)
    found = np.sum(weights * bary[:, 0] ** 2 * bary[:, 1] * bary[:, 2] ** 2) / 6.0
    assert found == pytest.approx(4.0 / 40320.0, rel=1e-13)


@pytest.mark.parametrize("n", [4, 8, 16])
def test_errors_are_those_of_dolfinx(n: int, device: str) -> None:
    """Its quadrature rules of the same degrees have other points: five digits agree, and more on finer meshes."""
    l2, h1 = errors(n, device)
    assert l2 == pytest.approx(NUMBERS[f"P1 n={n}"]["l2"], rel=1e-5)
    assert h1 == pytest.approx(NUMBERS[f"P1 n={n}"]["h1"], rel=1e-6)


@pytest.mark.parametrize("n", [4, 8])
def test_rates(n: int, device: str) -> None:
    coarse, fine = errors(n, device), errors(2 * n, device)
    assert np.log2(coarse[0] / fine[0]) >= 1.85
    assert np.log2(coarse[1] / fine[1]) >= 0.97
