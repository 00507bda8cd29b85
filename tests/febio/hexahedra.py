"""A test problem on FEBio's own hexahedra: FElupe's elements, warpbrain's materials at their quadrature points.

FEBio gives trilinear hexahedra of uncoupled materials one pressure and one dilatation each (Simo, Taylor and Pister
1985); `U(J)` is then that of the element's mean dilatation.
"""

from typing import Any

import felupe
import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import spsolve

from febio.laws import is_volumetric, volumetric_derivatives
from febio.materials import Constitution, constitution
from febio.points import Points
from febio.problem import Floats, Problem


class _AtPoints:
    """A material of FElupe's: `P` and `dP/dF` of warpbrain's at points (3, 3, q, c)."""

    def __init__(self, part: Constitution, device: str) -> None:
        self.part, self.device = part, device
        self.x = [np.eye(3), np.zeros(0)]
        self._points: Points | None = None
        self._last: tuple[Floats, Floats, Floats] | None = None

    def _evaluate(self, F: Floats) -> tuple[Floats, Floats]:
        if self._last is None or not np.array_equal(self._last[0], F):
            flat = np.moveaxis(F, (0, 1), (-2, -1)).reshape(-1, 3, 3)
            if self._points is None:
                self._points = Points(self.part, len(flat), self.device)
            P, A = self._points.evaluate(flat)
            q, c = F.shape[2:]
            P = np.moveaxis(P.reshape(q, c, 3, 3), (-2, -1), (0, 1))
            A = np.moveaxis(A.reshape(q, c, 3, 3, 3, 3), (-4, -3, -2, -1), (0, 1, 2, 3))
            self._last = F.copy(), P, A
        return self._last[1:]

    def gradient(self, x: list[Any]) -> list[Any]:
        return [self._evaluate(x[0])[0], x[-1]]

    def hessian(self, x: list[Any]) -> list[Any]:
        return [self._evaluate(x[0])[1]]


class _ThreeFields(_AtPoints):
    """`W(F) + p (det F - J) + U(J)` with a pressure `p` and a dilatation `J` of each element."""

    def __init__(self, part: Constitution, device: str) -> None:
        *others, volume = sorted(part.mechanisms, key=is_volumetric)
        super().__init__(Constitution(part.material, tuple(others)), device)
        self.volume = volume
        self.x = [np.eye(3), np.zeros(1), np.ones(1), np.zeros(0)]

    @staticmethod
    def _cofactor(F: Floats) -> tuple[Floats, Floats]:
        points = np.moveaxis(F, (0, 1), (-2, -1))
        det = np.linalg.det(points)
        return det, np.moveaxis(np.swapaxes(np.linalg.inv(points), -1, -2), (-2, -1), (0, 1))

    def gradient(self, x: list[Any]) -> list[Any]:
        F, p, J = x[:3]
        det, T = self._cofactor(F)
        first, _ = volumetric_derivatives(self.volume, J)
        return [self._evaluate(F)[0] + p * det * T, det - J, first - p, x[-1]]

    def hessian(self, x: list[Any]) -> list[Any]:
        F, p, J = x[:3]
        det, T = self._cofactor(F)
        turned = np.einsum("ij...,kl...->ijkl...", T, T) - np.einsum("il...,kj...->ijkl...", T, T)
        _, second = volumetric_derivatives(self.volume, J)
        ones = np.ones_like(p)
        return [self._evaluate(F)[1] + p * det * turned, det * T, 0.0 * T, 0.0 * p, -ones, second * ones]


def _solid(problem: Problem, part: Constitution, mesh: Any, device: str) -> Any:
    region = felupe.RegionHexahedron(mesh)
    if any(is_volumetric(mechanism) for mechanism in part.mechanisms) and part.material.formulation == "uncoupled":
        field = felupe.FieldsMixed(region, n=3)
        return felupe.SolidBody(_ThreeFields(part, device), field)
    field = felupe.FieldContainer([felupe.Field(region, dim=3)])
    return felupe.SolidBody(_AtPoints(part, device), field)


def _pressure(problem: Problem, mesh: Any, faces: list[list[int]], field: Any) -> Any:
    """FElupe's pressure on the faces."""
    wanted = {tuple(sorted(face)) for face in faces}
    region = felupe.RegionHexahedronBoundary(mesh)
    on = [i for i, face in enumerate(region.mesh.cells_faces) if tuple(sorted(face)) in wanted]
    assert len(on) == len(wanted)
    chosen = felupe.RegionHexahedronBoundary(mesh, mask=_mask(mesh, faces))
    boundary = felupe.FieldContainer([felupe.Field(chosen, dim=3)])
    boundary[0].values = field[0].values
    return felupe.SolidBodyPressure(boundary)


def _mask(mesh: Any, faces: list[list[int]]) -> Any:
    mask = np.zeros(mesh.npoints, dtype=bool)
    mask[np.unique(faces)] = True
    return mask


def solve_on_hexahedra(problem: Problem, device: str, steps: int | None = None) -> float:
    """The golden number of a static problem of hexahedra of one material."""
    assert (
        problem.analysis == "static"
        and not (problem.forces and problem.tractions)
        and len(problem.elements) == 1
        and problem.elements[0]["type"] == "hex8"
    )
    mesh = felupe.Mesh(np.array(problem.nodes), np.array(problem.elements[0]["nodes"]), "hexahedron")
    part = constitution(problem, problem.elements[0]["material"], problem.end)
    solid = _solid(problem, part, mesh, device)
    field = solid.field
    pressures = [(_pressure(problem, mesh, p["faces"], field), p) for p in problem.pressures]
    held, end_values = problem.constraints(problem.end)
    size = sum(f.values.size for f in field.fields)
    fixed = np.flatnonzero(held.ravel())
    free = np.setdiff1d(np.arange(size), fixed)
    forces = np.zeros(size)
    count = steps or problem.steps
    for step in range(1, count + 1):
        share = step / count
        if problem.forces:
            forces[: held.size] = share * problem.nodal_forces(problem.end).ravel()
        for item, p in pressures:
            # FElupe's positive pressure pulls
            item.results.pressure = -share * p["value"] * problem.factor(p["curve"], problem.end)
        target = share * end_values.ravel()[fixed]
        for _iteration in range(40):
            if problem.tractions:
                forces[: held.size] = share * problem.traction_forces(field[0].values, problem.end).ravel()
            residual = -forces + solid.assemble.vector(field).toarray().ravel()
            K = solid.assemble.matrix(field)
            if problem.springs:
                pull, stiffness = _pull(problem, field[0].values)
                residual[: held.size] += pull
                K = K + sparse.block_diag([stiffness, sparse.csr_matrix(2 * (size - held.size,))])
            for item, _ in pressures:
                item.field[0].values[:] = field[0].values
                residual[: held.size] += item.assemble.vector(item.field).toarray().ravel()
                K = K + sparse.block_diag(
                    [item.assemble.matrix(item.field), sparse.csr_matrix(2 * (size - held.size,))]
                )
            change = np.zeros(size)
            change[fixed] = target - field[0].values.ravel()[fixed]
            K = sparse.csr_matrix(K)
            change[free] = spsolve(K[free][:, free].tocsc(), -residual[free] - K[free][:, fixed] @ change[fixed])
            _add(field, change)
            if np.linalg.norm(change) < 1e-11 * (1.0 + np.linalg.norm(field[0].values)):
                break
        else:
            raise AssertionError(f"{problem.name}: no equilibrium at {share:.3g} of the load")
    return problem.norm(field[0].values)


def _pull(problem: Problem, u: Floats) -> tuple[Floats, sparse.csr_matrix]:
    """Forces of the springs, (3n,), and their derivatives."""
    points = np.array(problem.nodes)
    gradient = np.zeros(u.size)
    hessian = sparse.lil_matrix((u.size, u.size))
    for spring in problem.springs:
        a, b = spring["nodes"]
        rest = np.linalg.norm(points[b] - points[a])
        along = points[b] + u[b] - points[a] - u[a]
        block = spring["stiffness"] * np.eye(3)
        if rest > 0.0:
            length = np.linalg.norm(along)
            across = np.eye(3) - np.outer(along, along) / length**2
            block -= spring["stiffness"] * rest / length * across
            along *= 1.0 - rest / length
        pull = spring["stiffness"] * along
        for i, sign in ((a, -1.0), (b, 1.0)):
            gradient[3 * i : 3 * i + 3] += sign * pull
            for j, other in ((a, -1.0), (b, 1.0)):
                hessian[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] += sign * other * block
    return gradient, hessian.tocsr()


def _add(field: Any, change: Floats) -> None:
    start = 0
    for part in field.fields:
        part.values += change[start : start + part.values.size].reshape(part.values.shape)
        start += part.values.size
