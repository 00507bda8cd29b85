"""The two shapes that a law's device code can have: in invariants, or in principal stretches."""

from dataclasses import dataclass
from typing import Any

from warpbrain.kernels.precision import Precision
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
