"""Linear elasticity on the mesh that a case declares: linear tetrahedra, solved directly."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from referee.faces import Floats
from warpbrain.cases.boundary import Displaced, Fixed, Forced
from warpbrain.cases.case import Case
from warpbrain.errors import SolveError

Bools = NDArray[np.bool_]


class Elastic:
    """The linear answer of a case's mesh to forces.

    Parameters
    ----------
    case : Case
    """

    def __init__(self, case: Case) -> None:
        self.case, self.mesh = case, case.mesh
        corners = self.mesh.points[self.mesh.tetrahedra]
        sides = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
        inverse = np.linalg.inv(sides)
        #: Gradients (m, 4, 3) of the shape functions [1/m] and volumes (m,) [m3].
        self.gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        self.volumes = np.abs(np.linalg.det(sides)) / 6.0
        moduli = {label: tissue.known_law.shear_modulus for label, tissue in case.tissues.items()}
        self.mu = np.array([moduli[label] for label in self.mesh.tissue.tolist()])
        self.lam = self.mu * 2.0 * case.poisson / (1.0 - 2.0 * case.poisson)
        g = self.gradients
        dot = np.einsum("eai,ebi->eab", g, g)
        cross = np.einsum("eai,ebk->eaibk", g, g)
        local = self.lam[:, None, None, None, None] * cross
        local += self.mu[:, None, None, None, None] * (
            np.swapaxes(cross, 2, 4) + np.einsum("eab,ik->eaibk", dot, np.eye(3))
        )
        self.local = (self.volumes[:, None, None, None, None] * local).reshape(-1, 12, 12)
        self.dofs = (3 * self.mesh.tetrahedra.astype(np.int64)[:, :, None] + np.arange(3)).reshape(-1, 12)

    @property
    def centroids(self) -> Floats:
        """Middles of the tetrahedra [m]."""
        return self.mesh.points[self.mesh.tetrahedra].mean(axis=1)

    @cached_property
    def matrix(self) -> csc_matrix:
        """Stiffness of all nodes [N/m]."""
        rows, columns = np.broadcast_arrays(self.dofs[:, :, None], self.dofs[:, None, :])
        n = 3 * len(self.mesh.points)
        return csc_matrix((self.local.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))

    @cached_property
    def held(self) -> tuple[Bools, Floats]:
        """What the case holds (3 n,), and where [m]."""
        held = np.zeros((len(self.mesh.points), 3), dtype=bool)
        value = np.zeros(held.shape)
        for boundary in self.case.boundaries:
            members = self.mesh.node_sets[boundary.nodes]
            if isinstance(boundary, Fixed | Displaced):
                held[members] = True
            if isinstance(boundary, Displaced):
                value[members] = boundary.values[-1]
        return held.ravel(), value.ravel()

    @cached_property
    def fast(self) -> Solver:
        """Solver with all that the case holds."""
        return Solver(self.matrix, self.held[0])

    def released(self, loose: Bools) -> Floats:
        """Displacement (3 n,) [m] if nodes (n,) are not held after all.

        By conjugate gradients, for which what the case holds is factorised already.
        """
        from scipy.sparse.linalg import LinearOperator, cg

        held = self.held[0]
        freed = held & np.repeat(loose, 3)
        free = ~held | freed
        diagonal = self.matrix.diagonal()

        def times(u: Floats) -> Floats:
            return np.where(free, self.matrix @ np.where(free, u, 0.0), u)

        def near(r: Floats) -> Floats:
            return self.fast(r) + np.where(~held, 0.0, np.where(freed, r / diagonal, r))

        shape = self.matrix.shape
        # what is left of the forces where nodes were held is what moves them
        left = np.where(free, self.load - self.matrix @ self.declared, 0.0)
        matrix, inverse = (LinearOperator(shape, act, dtype=np.float64) for act in (times, near))
        move, failed = cg(matrix, left, rtol=1e-2, maxiter=300, M=inverse)
        if failed:
            raise SolveError(f"{self.case.name}: no linear answer with {loose.sum()} nodes that are not held")
        return self.declared + move

    @cached_property
    def load(self) -> Floats:
        """Declared forces (3 n,) [N]."""
        force = np.zeros((len(self.mesh.points), 3))
        for boundary in self.case.boundaries:
            if isinstance(boundary, Forced):
                members = self.mesh.node_sets[boundary.nodes]
                force[members] += np.asarray(boundary.total) / members.sum()
        return force.ravel()

    @cached_property
    def declared(self) -> Floats:
        """Displacement (3 n,) [m] under what the case declares."""
        value = self.held[1]
        return value + self.fast(self.load - self.matrix @ value)

    def _gathered(self, local: Floats) -> Floats:
        forces: Floats = np.bincount(self.dofs.ravel(), local.ravel(), minlength=3 * len(self.mesh.points)).astype(
            float
        )
        return forces

    def inner(self, weight: Floats) -> Floats:
        """Internal forces (3 n,) [N] of the declared state in elements with weights (m,)."""
        local = (self.local @ self.declared[self.dofs][..., None])[..., 0] * weight[:, None]
        return self._gathered(local)

    def stress(self, P: Floats) -> Floats:
        """Forces (3 n,) [N] that a stress (m, 3, 3) [Pa] exerts on nodes."""
        local = -self.volumes[:, None, None] * (self.gradients @ np.swapaxes(P, 1, 2))
        return self._gathered(local)


class Solver:
    """A factorised stiffness.

    Parameters
    ----------
    matrix : (3 n, 3 n) matrix
    held : (3 n,) bool array
    """

    def __init__(self, matrix: csc_matrix, held: Bools) -> None:
        self._free = np.flatnonzero(~held)
        inside = matrix[self._free][:, self._free].tocsc()
        options = {"SymmetricMode": True}
        self._factors = splu(inside, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)

    def __call__(self, force: Floats) -> Floats:
        u = np.zeros_like(force)
        u[self._free] = self._factors.solve(force[self._free])
        return u
