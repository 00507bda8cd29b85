"""The declared body in equilibrium: linear tetrahedra, neo-Hookean, finite deformation.

    Psi = mu/2 (tr F^T F - 3) - mu ln J + lam/2 (ln J)^2
    P = mu (F - F^-T) + lam ln J F^-T

Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, section 6.4.3.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import rslab
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, tril
from scipy.sparse.linalg import LinearOperator, cg

from referee.errors import InputError
from referee.faces import Floats
from warpbrain.cases.boundary import Displaced, Fixed, Forced
from warpbrain.cases.case import Case

Bools = NDArray[np.bool_]

#: Forces left, relative to those that act; Newton steps, and halvings of each.
_CLOSE, _STEPS, _HALVINGS = 1e-5, 30, 8
#: Relative residual of the linear solves: Newton's method needs no more.
_LINEAR = 1e-3


class NeoHookeanBody:
    """The declared body of a case.

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
        self.dofs = (3 * self.mesh.tetrahedra.astype(np.int64)[:, :, None] + np.arange(3)).reshape(-1, 12)

    @cached_property
    def centroids(self) -> Floats:
        """Middles of the tetrahedra [m]."""
        return self.mesh.points[self.mesh.tetrahedra].mean(axis=1)

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
    def load(self) -> Floats:
        """Declared forces (3 n,) [N]."""
        force = np.zeros((len(self.mesh.points), 3))
        for boundary in self.case.boundaries:
            if isinstance(boundary, Forced):
                members = self.mesh.node_sets[boundary.nodes]
                force[members] += np.asarray(boundary.total) / members.sum()
        return force.ravel()

    def gradient(self, u: Floats) -> Floats:
        """Deformation gradients (m, 3, 3) of a displacement (3 n,) [m]."""
        F: Floats = np.eye(3) + np.swapaxes(u.reshape(-1, 3)[self.mesh.tetrahedra], 1, 2) @ self.gradients
        return F

    def stress(self, F: Floats) -> Floats:
        """First Piola-Kirchhoff stress (m, 3, 3) [Pa]."""
        inverse = np.swapaxes(np.linalg.inv(F), 1, 2)
        log_J = np.log(np.linalg.det(F))
        return self.mu[:, None, None] * (F - inverse) + (self.lam * log_J)[:, None, None] * inverse

    def nodal(self, P: Floats) -> Floats:
        """Internal forces (3 n,) [N] of a stress (m, 3, 3) [Pa]."""
        return self.gathered(self.volumes[:, None, None] * (self.gradients @ np.swapaxes(P, 1, 2)))

    def gathered(self, local: Floats) -> Floats:
        """Forces (3 n,) of those on the corners (m, 4, 3)."""
        return np.bincount(self.dofs.ravel(), local.ravel(), minlength=3 * len(self.mesh.points)).astype(float)

    def tangent(self, F: Floats) -> csc_matrix:
        """Stiffness (3 n, 3 n) [N/m] about deformation gradients (m, 3, 3)."""
        g, h = self.gradients, self.gradients @ np.linalg.inv(F)
        cross = np.einsum("eai,ebk->eaibk", h, h)
        weight = self.mu - self.lam * np.log(np.linalg.det(F))
        local = self.lam[:, None, None, None, None] * cross
        local += weight[:, None, None, None, None] * np.swapaxes(cross, 2, 4)
        local += self.mu[:, None, None, None, None] * np.einsum("eab,ik->eaibk", g @ np.swapaxes(g, 1, 2), np.eye(3))
        local *= self.volumes[:, None, None, None, None]
        rows, columns = np.broadcast_arrays(self.dofs[:, :, None], self.dofs[:, None, :])
        n = 3 * len(self.mesh.points)
        return csc_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))

    def solver(self, matrix: csc_matrix) -> Callable[[Floats], Floats]:
        """What solves for all dofs (3 n,) or (3 n, k) that are not held; zero at those that are."""
        free = np.flatnonzero(~self.held[0])
        factors = rslab.ldlt(tril(matrix[free][:, free], format="csc"), threads=1)

        def solve(force: Floats) -> Floats:
            u = np.zeros_like(force)
            right = np.asfortranarray(force[free].reshape(len(free), -1))
            u[free] = factors.solve_many(right).reshape(force[free].shape)
            return u

        return solve

    @cached_property
    def declared(self) -> Floats:
        """Displacement (3 n,) [m] under what the case declares, by Newton's method.

        Each step is solved by conjugate gradients with the factors of the body at rest.

        Raises
        ------
        InputError
            If no equilibrium is found.
        """
        near = self.solver(self.tangent(np.tile(np.eye(3), (len(self.volumes), 1, 1))))
        held, value = self.held
        free, n = ~held, len(held)

        def unbalanced(u: Floats) -> Floats:
            F = self.gradient(u)
            if (np.linalg.det(F) <= 0.0).any():
                return np.full(n, np.inf)
            return self.load - self.nodal(self.stress(F))

        # what is held moves as declared, and all else with it as a linear body would
        u, step = np.zeros(n), value
        left = unbalanced(u)
        for _ in range(_STEPS):
            K = self.tangent(self.gradient(u))
            times = LinearOperator((n, n), lambda v, K=K: np.where(free, K @ np.where(free, v, 0.0), v), dtype=float)
            right = np.where(free, left - K @ step, 0.0)
            inverse = LinearOperator((n, n), lambda r: near(r) + np.where(held, r, 0.0), dtype=float)
            move = step + cg(times, right, rtol=_LINEAR, maxiter=200, M=inverse)[0]
            # as long as the boundary has not arrived, forces may grow: the step must turn no element inside out
            limit = np.inf if step.any() else float(np.linalg.norm(left[free]))
            for _ in range(_HALVINGS):
                after = unbalanced(u + move)
                if np.linalg.norm(after[free]) < limit:
                    break
                move = 0.5 * move
            u, left = u + move, after
            step = value - u * held
            step[np.abs(step) < 1e-12] = 0.0
            acting = np.linalg.norm(self.load) + np.linalg.norm(left[held])
            if not step.any() and np.linalg.norm(left[free]) <= _CLOSE * acting:
                return u
        raise InputError(f"{self.case.name}: no equilibrium of the declared body")
