"""The two shapes that a law's device code can have, in invariants or in principal stretches; and the code of growth.

Tissue that has grown or shrunk by itself has `F = F_e F_g` with `F_g = s I` (Rodriguez et al. 1994).
Only `F_e = F / s` is elastic, and the energy is that of the grown volume, `Psi_g(F) = s^3 Psi(F / s)`:

    in invariants          I1/s^2, I2/s^4, J/s^3 in the place of I1, I2, J
    in principal stretches l/s in the place of l

`s` is the last column of the parameters. The device code of a law is wrapped, not written again, and compiled only
where something grows.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import Precision
from warpbrain.kernels.tetrahedron import ElementKernels


@dataclass(frozen=True)
class InvariantLaw:
    """Device functions of a law `Psi(I1, I2, J)`; see `warpbrain.kernels.invariants`."""

    key: str
    energy: Any
    derivatives: Any
    second_invariant: bool

    def kernels(self, precision: Precision) -> ElementKernels:
        """Element kernels in a precision, made once."""
        from warpbrain.kernels.invariants import invariant_kernels

        return invariant_kernels(self.key, self.energy, self.derivatives, self.second_invariant, precision)


@dataclass(frozen=True)
class PrincipalLaw:
    """Device functions of a law in principal stretches; see `warpbrain.kernels.principal`."""

    key: str
    energy: Any
    derivatives: Any

    def kernels(self, precision: Precision) -> ElementKernels:
        """Element kernels in a precision, made once."""
        from warpbrain.kernels.principal import principal_kernels

        return principal_kernels(self.key, self.energy, self.derivatives, precision)


@cache
def grown(law: InvariantLaw | PrincipalLaw) -> InvariantLaw | PrincipalLaw:
    """The device code of a law of which each element has a growth stretch `s`."""
    energy, derivatives = law.energy, law.derivatives
    if isinstance(law, PrincipalLaw):

        @wp.func
        def principal_energy(l: Any, parameters: wp.array2d[Any], e: int):
            s = parameters[e, parameters.shape[1] - 1]
            return s * s * s * energy(l / s, parameters, e)

        @wp.func
        def principal_derivatives(l: Any, parameters: wp.array2d[Any], e: int):
            s = parameters[e, parameters.shape[1] - 1]
            T, H, m = derivatives(l / s, parameters, e)
            return s * s * T, s * H, s * m

        return PrincipalLaw(f"{law.key}_grown", principal_energy, principal_derivatives)

    @wp.func
    def invariant_energy(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
        s = parameters[e, parameters.shape[1] - 1]
        s2 = s * s
        return s2 * s * energy(I1 / s2, I2 / (s2 * s2), J / (s2 * s), parameters, e)

    @wp.func
    def invariant_derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
        s = parameters[e, parameters.shape[1] - 1]
        s2 = s * s
        s3 = s2 * s
        d1, d2, dJ, d11, d12, d1J, d22, d2J, dJJ = derivatives(I1 / s2, I2 / (s2 * s2), J / s3, parameters, e)
        return (
            s * d1, d2 / s, dJ,
            d11 / s, d12 / s3, d1J / s2, d22 / (s2 * s3), d2J / (s2 * s2), dJJ / s3,
        )  # fmt: skip

    return InvariantLaw(f"{law.key}_grown", invariant_energy, invariant_derivatives, law.second_invariant)
