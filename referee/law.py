"""Laws of tissue in logarithmic principal stretches, with all derivatives, none of which the tool declares.

With ``e_i = ln l_i`` and ``t_i = dPsi/de_i``, ``H = d2Psi/de2`` the first Piola-Kirchhoff stress has the principal
values ``t_i / l_i`` in the axes of ``F = U diag(l) V^T``, and its derivative there the entries (Ogden, Non-Linear
Elastic Deformations, section 6.1.4)

    (ii, jj):  (H_ij - delta_ij t_i) / (l_i l_j)
    (ij, ij):  a = (t_i - t_j) / (l_i^2 - l_j^2)
    (ij, ji):  (l_j^2 a - t_j) / (l_i l_j)
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from referee.principal import Stretches, derivatives, stretches_of

Floats = NDArray[np.float64]

#: Logarithms of stretches that differ by less are taken as equal.
_EQUAL = 1e-4
_DEVIATOR = np.eye(3) - 1.0 / 3.0


@dataclass(frozen=True)
class Law(abc.ABC):
    """The isochoric part, of unit shear modulus at rest."""

    kind: ClassVar[str]

    @abc.abstractmethod
    def energy(self, e: Floats) -> Floats:
        """Energy of isochoric logarithmic stretches (..., 3)."""

    @abc.abstractmethod
    def slopes(self, e: Floats) -> tuple[Floats, Floats]:
        """First (..., 3) and second (..., 3, 3) derivatives of the energy."""


@dataclass(frozen=True)
class Ogden(Law):
    """``Psi = sum_p 2 w_p / alpha_p^2 sum_i (l_i^alpha_p - 1)``, with shares ``w_p`` that sum to 1."""

    kind: ClassVar[str] = "ogden"
    shares: tuple[float, ...]
    exponents: tuple[float, ...]

    def energy(self, e: Floats) -> Floats:
        return sum(
            2.0 * w / a**2 * (np.exp(a * e) - 1.0).sum(axis=-1)
            for w, a in zip(self.shares, self.exponents, strict=True)
        )

    def slopes(self, e: Floats) -> tuple[Floats, Floats]:
        first, second = np.zeros_like(e), np.zeros_like(e)
        for w, a in zip(self.shares, self.exponents, strict=True):
            power = 2.0 * w * np.exp(a * e)
            first += power / a
            second += power
        return first, second[..., None] * np.eye(3)


@dataclass(frozen=True)
class Demiray(Law):
    """``Psi = (exp(b (I1 - 3)) - 1) / (2 b)`` (Demiray 1972)."""

    kind: ClassVar[str] = "demiray"
    b: float

    def energy(self, e: Floats) -> Floats:
        return np.expm1(self.b * (np.exp(2.0 * e).sum(axis=-1) - 3.0)) / (2.0 * self.b)

    def slopes(self, e: Floats) -> tuple[Floats, Floats]:
        x = np.exp(2.0 * e)
        factor = np.exp(self.b * (x.sum(axis=-1) - 3.0))[..., None]
        outer = 2.0 * self.b * x[..., :, None] * x[..., None, :]
        return factor * x, factor[..., None] * (2.0 * x[..., None] * np.eye(3) + outer)


@dataclass(frozen=True, eq=False)
class Response:
    """Stress and its derivative in the principal axes of deformation gradients (m, q, 3, 3).

    Attributes
    ----------
    u, v, stretch : arrays
        Singular vectors (m, q, 3, 3) and values (m, q, 3): ``F = u diag(stretch) v^T``.
    shape, volume : pairs of (m, q, 3) and (m, q, 3, 3) array
        ``t`` and ``H`` of the isochoric and of the volumetric part [Pa].
    """

    u: Floats
    v: Floats
    stretch: Floats
    shape: tuple[Floats, Floats]
    volume: tuple[Floats, Floats]

    def of(self, some: slice) -> Response:
        """That of some tetrahedra."""
        shape, volume = ((t[some], H[some]) for t, H in (self.shape, self.volume))
        return Response(self.u[some], self.v[some], self.stretch[some], shape, volume)

    def stress(self, factor: float = 1.0) -> Floats:
        """First Piola-Kirchhoff stress (m, q, 3, 3) [Pa], the isochoric part multiplied by a factor."""
        t = factor * self.shape[0] + self.volume[0]
        return (self.u * (t / self.stretch)[..., None, :]) @ np.swapaxes(self.v, -1, -2)

    def second(self) -> Floats:
        """Isochoric second Piola-Kirchhoff stress (m, q, 3, 3) [Pa]."""
        return (self.v * (self.shape[0] / self.stretch**2)[..., None, :]) @ np.swapaxes(self.v, -1, -2)

    def tangent(self, factor: float = 1.0) -> Floats:
        """Derivative (m, q, 3, 3, 3, 3) [Pa] of the stress ``P_iJ`` by the gradient ``F_kL``, as [J, L, i, k].

        So lie the numbers that gradients of nodes, along J and L, make the blocks of a matrix of.
        """
        l = self.stretch
        t, H = (factor * shape + volume for shape, volume in zip(self.shape, self.volume, strict=True))
        both = H.copy()
        both[..., range(3), range(3)] -= t
        both /= l[..., :, None] * l[..., None, :]
        same, other = np.zeros_like(both), np.zeros_like(both)
        i, j = np.array([0, 0, 1]), np.array([1, 2, 2])
        e, product = np.log(l), l[..., i] * l[..., j]
        near = np.abs(e[..., i] - e[..., j]) < _EQUAL
        apart = np.where(near, 1.0, l[..., i] ** 2 - l[..., j] ** 2)
        limit = (0.5 * (H[..., i, i] + H[..., j, j]) - H[..., i, j]) / (2.0 * product)
        a = np.where(near, limit, (t[..., i] - t[..., j]) / apart)
        same[..., i, j] = same[..., j, i] = a
        other[..., i, j] = other[..., j, i] = (l[..., j] ** 2 * a - t[..., j]) / product
        return derivatives(self.u, self.v, both, same, other)


def respond(
    law: Law, F: Floats, mu: Floats, bulk: Floats, growth: Floats, stretches: Stretches | None = None
) -> Response:
    """Response of tissue that has grown.

    The volumetric energy is ``K/4 (J^2 - 1 - 2 ln J)``; growth changes the volume without stress by a factor
    ``exp(growth)``, and the energy is that of the part which is left, for each volume that has grown (Rodriguez et al.
    1994).

    Parameters
    ----------
    law : Law
    F : (m, q, 3, 3) array
    mu, bulk, growth : (m, 1) or (m, q) array
        Shear and bulk modulus [Pa], and the logarithm of the volume without stress.
    stretches : Stretches, optional
        Of `F`, where they are known.
    """
    u, v, stretch = stretches_of(F) if stretches is None else stretches
    e = np.log(stretch) - growth[..., None] / 3.0
    trace = e.sum(axis=-1, keepdims=True)
    first, second = law.slopes(e - trace / 3.0)
    scale = (mu * np.exp(growth))[..., None]
    shape = scale * (first @ _DEVIATOR), scale[..., None] * (_DEVIATOR @ second @ _DEVIATOR)
    J2 = np.exp(2.0 * trace)
    scale = (bulk * np.exp(growth))[..., None]
    volume = scale * 0.5 * (J2 - 1.0) * np.ones(3), (scale * J2)[..., None] * np.ones((3, 3))
    return Response(u, v, stretch, shape, volume)
