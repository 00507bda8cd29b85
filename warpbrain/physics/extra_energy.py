"""A term whose energy is added to that of tetrahedra: fibres, residual stress.

It is part of the tissue: an energy of the elastic deformation `F_e = F F_g^-1` on the grown volume, times a factor
of each element: that on its moduli, or the part of it that is left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.kernels.extra_energy import extra_kernels
from warpbrain.kernels.ten_nodes import TEN_NODES
from warpbrain.kernels.tetrahedron import FOUR_NODES
from warpbrain.physics.term import Body, KernelTerm


@dataclass(frozen=True)
class ExtraEnergy:
    """Device functions of an added energy; see `warpbrain.kernels.extra_energy`."""

    key: str  # part of the name of the compiled module
    energy: Any
    stress: Any
    moduli: Any
    #: ``"moduli"``: times the factor on the moduli of an element (fibres); ``"tissue"``: times the part of it that is
    #: left (a tension, which is no modulus)
    goes_with: str = "moduli"


class ExtraEnergyTerm(KernelTerm):
    """An added energy on some elements (k,) of a body, with numbers (k, c) of each; the ramp is over time [s]."""

    def __init__(
        self,
        body: Body,
        code: ExtraEnergy,
        elements: NDArray[np.integer],
        data: Floats,
        ramp: Callable[[float], float],
    ) -> None:
        stencil = FOUR_NODES if body.quadratic is None else TEN_NODES
        kernels = extra_kernels(code.key, code.energy, code.stress, code.moduli, body.precision, stencil)
        super().__init__(body, body.stencils[elements], kernels, ramp)
        scalar = body.precision.scalar
        self.elements, self.of_moduli = elements, code.goes_with == "moduli"
        self._elements = self.array(elements, int)
        self._volume = self.array(body.mesh.volumes[elements], scalar)
        self._stretch = self.array(np.ones(len(elements)), scalar)
        self.take_moduli()
        self._data = self.array(data, scalar)

    def take_moduli(self) -> None:
        assert self.elements is not None
        body = self.body
        factor = body.stiffness_factors if self.of_moduli else body.remaining_parts
        self._volume.assign((factor * body.mesh.volumes)[self.elements])
        self._stretch.assign(body.growth_stretches[self.elements])

    def _inputs(self) -> list[Any]:
        body = self.body
        geometry = [self._elements, body.element_nodes, body.inverse_edges, self._volume, self._stretch]
        return [*geometry, self._data, self.scale]
