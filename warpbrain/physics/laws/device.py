"""The two shapes that a law's device code can have, in invariants or in principal stretches; and that of growth."""

from dataclasses import dataclass
from functools import cache
from typing import Any

from warpbrain.kernels.invariants import invariant_kernels
from warpbrain.kernels.module import Precision
from warpbrain.kernels.principal import principal_kernels
from warpbrain.kernels.tetrahedron import ElementKernels, law_kernels, of_elastic_part


@dataclass(frozen=True)
class InvariantLaw:
    """Device functions of a law `Psi(I1, I2, J)`; see `warpbrain.kernels.invariants`."""

    key: str
    energy: Any
    derivatives: Any
    second_invariant: bool

    def kernels(self, precision: Precision) -> ElementKernels:
        """Element kernels in a precision, made once."""
        return invariant_kernels(self.key, self.energy, self.derivatives, self.second_invariant, precision)


@dataclass(frozen=True)
class PrincipalLaw:
    """Device functions of a law in principal stretches; see `warpbrain.kernels.principal`."""

    key: str
    energy: Any
    derivatives: Any

    def kernels(self, precision: Precision) -> ElementKernels:
        """Element kernels in a precision, made once."""
        return principal_kernels(self.key, self.energy, self.derivatives, precision)


@dataclass(frozen=True)
class GrownLaw:
    """A law of which each element has a growth stretch; see `warpbrain.kernels.tetrahedron.of_elastic_part`."""

    law: InvariantLaw | PrincipalLaw

    @property
    def key(self) -> str:
        """Of the law that has grown."""
        return f"{self.law.key}_grown"

    @cache  # noqa: B019  (there are as many as laws)
    def kernels(self, precision: Precision) -> ElementKernels:
        """Element kernels in a precision, made once."""
        plain = self.law.kernels(precision)
        functions = of_elastic_part(plain.stress_at, plain.energy_at, plain.tangents, precision)
        return law_kernels(self.key, *functions, precision)
