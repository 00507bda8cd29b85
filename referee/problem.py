"""What acts on a body: forces that must balance, and how they change with displacement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix

from referee.body import Body
from referee.law import Law, Response, respond
from referee.principal import Stretches

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
#: Forces (n, 3) [N] at a displacement (n, 3) [m].
Load = Callable[[Floats], Floats]
#: Tetrahedra whose matrices are made together: what they need stays in the processor's cache.
_TOGETHER = 512


class Inverted(Exception):
    """An element has turned inside out."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Problem:
    """A body at rest under loads.

    Parameters
    ----------
    body : Body
    law : Law
    mu, bulk, growth : (m, 1) array
        See `referee.law.respond`.
    held : (n, 3) bool array
        What does not move freely; `value` (n, 3) [m] is where it is.
    loads : tuple of Load
        Their derivatives are left to Newton's method, which converges a little more slowly for it.
    springs : callable or None
        Stiffness (n, 3, 3) [N/m] at a displacement (n, 3), and the displacement (n, 3) [m] to which it ties each node.
    stress : (m, q, 3, 3) array or None
        Second Piola-Kirchhoff stress [Pa] beside that of the law.
    factor : float
        On the isochoric stress of the law.
    """

    body: Body
    law: Law
    mu: Floats
    bulk: Floats
    growth: Floats
    held: Bools
    value: Floats
    loads: tuple[Load, ...] = ()
    springs: Callable[[Floats], tuple[Floats, Floats]] | None = None
    stress: Floats | None = None
    factor: float = 1.0

    def gradient(self, u: Floats) -> Floats:
        """Deformation gradients (m, q, 3, 3); `Inverted` if one is not a deformation."""
        reference, inverse = self.body.straight
        q, nodes, _ = reference.shape
        # products of few large matrices: those of a tetrahedron's own gradients are many and small
        moved = np.swapaxes(u[self.body.cells], 1, 2).reshape(-1, nodes) @ np.swapaxes(reference, 0, 1).reshape(
            nodes, -1
        )
        F = np.swapaxes((moved.reshape(-1, 3 * q, 3) @ inverse).reshape(-1, 3, q, 3), 1, 2) + np.eye(3)
        if np.linalg.det(F).min() <= 0.0:
            raise Inverted
        return F

    def response(self, F: Floats, stretches: Stretches | None = None) -> Response:
        """Of the law."""
        return respond(self.law, F, self.mu, self.bulk, self.growth, stretches)

    def local(self, P: Floats) -> Floats:
        """Forces (m, 10, 3) [N] of a stress (m, q, 3, 3) [Pa] on the nodes of each tetrahedron."""
        volumes, (reference, inverse) = self.body.region[0], self.body.straight
        q, nodes, _ = reference.shape
        pulled = np.swapaxes(P * volumes[..., None, None], 1, 2).reshape(-1, 3 * q, 3) @ np.swapaxes(inverse, 1, 2)
        forces = pulled.reshape(-1, 3 * q) @ np.swapaxes(reference, 1, 2).reshape(3 * q, nodes)
        return np.swapaxes(forces.reshape(-1, 3, nodes), 1, 2)

    def gathered(self, local: Floats) -> Floats:
        """Forces (n, 3) [N] on all nodes."""
        cells, n = self.body.cells.ravel(), len(self.body.points)
        return np.stack([np.bincount(cells, local[..., k].ravel(), minlength=n) for k in range(3)], axis=1)

    def residual(self, u: Floats, F: Floats, response: Response) -> Floats:
        """Internal minus external forces (n, 3) [N]."""
        P = response.stress(self.factor)
        if self.stress is not None:
            P = P + F @ self.stress
        out = self.gathered(self.local(P))
        for load in self.loads:
            out -= load(u)
        if self.springs is not None:
            stiffness, rest = self.springs(u)
            out += (stiffness @ (u - rest)[..., None])[..., 0]
        return out

    def tangent(self, u: Floats, response: Response, precision: type[np.floating] = np.float64) -> bsr_matrix:
        """Derivative of the residual, without that of the loads."""
        volumes, (reference, inverse) = self.body.region[0], self.body.straight
        cells, q = volumes.shape
        products = np.einsum("qaJ,qbL->abqJL", reference, reference).reshape(100, -1).astype(precision)
        local = np.empty((cells, 100, 9), precision)
        for start in range(0, cells, _TOGETHER):
            some = slice(start, start + _TOGETHER)
            # with stretches along reference axes, so that gradients of nodes are the same in all tetrahedra
            axes = inverse[some, None]
            part = response.of(some)
            A = replace(part, v=axes @ part.v).tangent(self.factor)
            if self.stress is not None:
                # delta_ik S_JL
                S = axes @ self.stress[some] @ np.swapaxes(axes, -1, -2)
                A += S[..., None, None] * np.eye(3)
            A *= volumes[some, :, None, None, None, None]
            np.matmul(products, A.reshape(-1, 9 * q, 9).astype(precision), out=local[some])
        return self.body.pattern.matrix(local, None if self.springs is None else self.springs(u)[0])
