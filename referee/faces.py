"""Quadratic triangles of a surface, and loads on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def _rule() -> tuple[Floats, Floats]:
    """Points (7, 2) and weights of the rule of degree 5 of Radon on the unit triangle."""
    root = np.sqrt(15.0)
    a, b = (6.0 - root) / 21.0, (6.0 + root) / 21.0
    third = 1.0 / 3.0
    points = [(third, third), (a, a), (1 - 2 * a, a), (a, 1 - 2 * a), (b, b), (1 - 2 * b, b), (b, 1 - 2 * b)]
    wa, wb = (155.0 - root) / 2400.0, (155.0 + root) / 2400.0
    return np.array(points), np.array([9.0 / 80.0, wa, wa, wa, wb, wb, wb])


_POINTS, _WEIGHTS = _rule()
_R, _S = _POINTS.T
_T = 1.0 - _R - _S
#: Shape functions (7, 6) and their derivatives (7, 6) along both sides.
_N = np.stack([_T * (2 * _T - 1), _R * (2 * _R - 1), _S * (2 * _S - 1), 4 * _T * _R, 4 * _R * _S, 4 * _S * _T], axis=1)
_ZERO = np.zeros_like(_R)
_NR = np.stack([1 - 4 * _T, 4 * _R - 1, _ZERO, 4 * (_T - _R), 4 * _S, -4 * _S], axis=1)
_NS = np.stack([1 - 4 * _T, _ZERO, 4 * _S - 1, -4 * _R, 4 * _R, 4 * (_T - _S)], axis=1)


@dataclass(frozen=True, eq=False)
class Faces:
    """Triangles of six nodes, seen from outside counterclockwise.

    Parameters
    ----------
    points : (n, 3) array
        All nodes of the body [m].
    nodes : (f, 6) int array
        Corners, then middles of the sides 0-1, 1-2, 2-0.
    """

    points: Floats
    nodes: Ints

    @cached_property
    def places(self) -> Floats:
        """Quadrature points (f, 7, 3) [m]."""
        return np.einsum("qa,fai->fqi", _N, self.points[self.nodes])

    def vectors(self, points: Floats) -> Floats:
        """Outward area (f, 7, 3) [m2] of each quadrature point of the faces with nodes at points (n, 3)."""
        x = points[self.nodes]
        along, across = np.einsum("qa,fai->fqi", _NR, x), np.einsum("qa,fai->fqi", _NS, x)
        return np.cross(along, across) * _WEIGHTS[:, None]

    @cached_property
    def areas(self) -> Floats:
        """Area (f, 7) [m2] of each quadrature point."""
        return np.linalg.norm(self.vectors(self.points), axis=2)

    @cached_property
    def normals(self) -> Floats:
        """Outward unit normals (f, 7, 3)."""
        return self.vectors(self.points) / self.areas[..., None]

    def spread(self, values: Floats) -> Floats:
        """Nodal values (n, k) of what each quadrature point (f, 7, k) carries."""
        out = np.zeros((len(self.points), values.shape[2]))
        np.add.at(out, self.nodes, np.einsum("qa,fqk->fak", _N, values))
        return out

    def linear(self, corners: Floats) -> Floats:
        """Values (f, 7) of a field that is linear between the corners, given at all corners (c,)."""
        return corners[self.nodes[:, :3]] @ np.stack([_T, _R, _S])
