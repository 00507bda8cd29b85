"""What acts on a body: forces that must balance, and how they change with displacement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix

from referee.body import Body
from referee.law import Law, Response, respond

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
#: Forces (n, 3) [N] at a displacement (n, 3) [m].
Load = Callable[[Floats], Floats]
#: Tetrahedra whose matrices are made together: what they need stays in the processor's cache.
_TOGETHER = 128


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
        G = self.body.region[0]
        F = np.swapaxes(u[self.body.cells], 1, 2)[:, None] @ G + np.eye(3)
        if np.linalg.det(F).min() <= 0.0:
            raise Inverted
        return F

    def response(self, F: Floats) -> Response:
        """Of the law."""
        return respond(self.law, F, self.mu, self.bulk, self.growth)

    def local(self, P: Floats) -> Floats:
        """Forces (m, 10, 3) [N] of a stress (m, q, 3, 3) [Pa] on the nodes of each tetrahedron."""
        G, volumes, _ = self.body.region
        forces: Floats = (G @ np.swapaxes(P * volumes[..., None, None], -1, -2)).sum(axis=1)
        return forces

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

    def tangent(self, u: Floats, response: Response) -> bsr_matrix:
        """Derivative of the residual, without that of the loads."""
        G, volumes, _ = self.body.region
        cells, q = volumes.shape
        local = np.empty((cells, 10, 10, 3, 3))
        for start in range(0, cells, _TOGETHER):
            some = slice(start, start + _TOGETHER)
            A = response.of(some).tangent(self.factor)
            if self.stress is not None:
                # delta_ik S_JL
                for i in range(3):
                    A[..., 3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += self.stress[some]
            g = np.ascontiguousarray(G[some])
            # (i J, k L) -> (J, i k L)
            A = (A * volumes[some, :, None, None]).reshape(-1, q, 3, 3, 3, 3).transpose(0, 1, 3, 2, 4, 5)
            blocks = ((g @ A.reshape(-1, q, 3, 27)).reshape(-1, q, 90, 3) @ np.swapaxes(g, 2, 3)).sum(axis=1)
            local[some] = blocks.reshape(-1, 10, 3, 3, 10).transpose(0, 1, 4, 2, 3)
        return self.body.pattern.matrix(local, None if self.springs is None else self.springs(u)[0])
