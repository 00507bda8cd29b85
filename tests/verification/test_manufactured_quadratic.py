"""B4 on quadratic tetrahedra: rates of convergence, and the errors that DOLFINx makes on the same meshes."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from bodies import model_of
from manufactured import MATERIAL, exact, exact_gradient, gradients, norm, quadrature
from material_point import stress_at
from numpy.typing import NDArray
from shapes import cube
from verification_rows import Row

from warpbrain.mesh import QuadraticMesh, TetMesh
from warpbrain.mesh.integrals import shape_values
from warpbrain.mesh.surface import EDGES
from warpbrain.physics.load import Load
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.system import System

#: How far quadrature of another degree may put the errors apart, by the cells of a side.
WITHIN = {2: 0.03, 4: 0.02, 8: 0.01}
Floats = NDArray[np.float64]
NUMBERS = json.loads((Path(__file__).parent / "data" / "manufactured.json").read_text())


def shape_gradients(mesh: QuadraticMesh, bary: Floats) -> Floats:
    """Of the ten shape functions at barycentric points (q, 4), shape (m, q, 10, 3)."""
    g = gradients(mesh.points, mesh.elements[:, :4])
    corners = np.einsum("qa,eai->eqai", 4.0 * bary - 1.0, g)
    c, d = EDGES.T
    middles = 4.0 * (np.einsum("qk,eki->eqki", bary[:, c], g[:, d]) + np.einsum("qk,eki->eqki", bary[:, d], g[:, c]))
    return np.concatenate([corners, middles], axis=2)


@dataclass(frozen=True, kw_only=True)
class ManufacturedLoad(Load):
    """The body force of the solution, by its weak form `(P(grad u), grad v)`."""

    device: str
    quadratic: ClassVar[bool] = True

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        assert isinstance(mesh, QuadraticMesh)
        bary, weights = quadrature(4)
        X = np.einsum("qa,eai->eqi", bary, mesh.points[mesh.elements[:, :4]])
        F = np.eye(3) + exact_gradient(X)
        P = stress_at(MATERIAL, F.reshape(-1, 3, 3), self.device).reshape(F.shape)
        slopes = shape_gradients(mesh, bary)
        element = np.einsum("e,q,eqij,eqaj->eai", mesh.corners.volumes, weights, P, slopes)
        forces = np.zeros(mesh.points.shape)
        np.add.at(forces, mesh.elements, element)
        return forces


@cache
def errors(n: int, device: str) -> tuple[float, float]:
    """L2 norms of the error and of its gradient."""
    mesh = cube(n)
    nodes = QuadraticMesh(mesh)
    constrained = np.repeat(nodes.on_surface[:, None], 3, axis=1)
    prescribed = np.where(constrained, exact(nodes.points), 0.0)
    acts = {"constrained": constrained, "prescribed": prescribed, "loads": [ManufacturedLoad(device=device)]}
    system = System(model_of(mesh, MATERIAL, elements="tet10", **acts), device)
    u = solve_equilibrium(system, EquilibriumOptions(tolerance=1e-9)).u
    bary, weights = quadrature(5)
    own = u[nodes.elements]
    X = np.einsum("qa,eai->eqi", bary, nodes.points[nodes.elements[:, :4]])
    difference = np.einsum("qa,eai->eqi", shape_values(bary), own) - exact(X)
    slope = np.einsum("eai,eqaj->eqij", own, shape_gradients(nodes, bary)) - exact_gradient(X)

    return norm(mesh, weights, difference), norm(mesh, weights, slope)


@pytest.mark.parametrize("n", WITHIN)
def test_errors_are_those_of_dolfinx(n: int, device: str, verify: Row) -> None:
    """Errors of errors: less on every finer mesh, as those of quadrature are."""
    l2, h1 = errors(n, device)
    claim = f"errors in L2 and H1 of a manufactured solution, tet10, n = {n}, quadrature of another degree"
    error = max(abs(l2 / NUMBERS[f"P2 n={n}"]["l2"] - 1.0), abs(h1 / NUMBERS[f"P2 n={n}"]["h1"] - 1.0))
    verify(claim, "DOLFINx, the same elements", error, WITHIN[n])


@pytest.mark.parametrize("n", [2, 4])
def test_rates(n: int, device: str, verify: Row) -> None:
    short = np.array([3.0, 2.0]) - np.log2(np.divide(errors(n, device), errors(2 * n, device)))
    claim = "manufactured solution, tet10, regular meshes: orders 3 and 2 of displacement and gradient; short by"
    verify(claim, "exact", max(short.max(), 0.0), 0.15, "orders")
