"""A term whose energy is added to that of tetrahedra: fibres, residual stress.

It is part of the tissue: an energy of the elastic deformation `F_e = F F_g^-1` on the grown volume, times a factor
of each element: that on its moduli, or the part of it that is left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.kernels.extra_energy import extra_kernels, quadratic_extra_kernels
from warpbrain.kernels.multicore import launch
from warpbrain.physics.term import Body, Term


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


class ExtraEnergyTerm(Term):
    """An added energy on some elements of a body.

    Parameters
    ----------
    body : Body
    code : ExtraEnergy
    elements : (k,) int array
    data : (k, c) array
        The numbers of each of these elements.
    ramp : callable
        Factor over time [s].
    """

    def __init__(
        self,
        body: Body,
        code: ExtraEnergy,
        elements: NDArray[np.integer],
        data: NDArray[np.float64],
        ramp: Callable[[float], float],
    ) -> None:
        super().__init__(body, body.stencils[elements], ramp)
        scalar = body.precision.scalar
        kernels = extra_kernels if body.quadratic is None else quadratic_extra_kernels
        self._kernels = kernels(code.key, code.energy, code.stress, code.moduli, body.precision)
        self.elements, self.of_moduli = elements, code.goes_with == "moduli"
        self._elements = self.array(elements, int)
        self._volume = self.array(body.mesh.volumes[elements], scalar)
        self._stretch = self.array(np.ones(len(elements)), scalar)
        self.take_moduli()
        self._data = self.array(data, scalar)
        self._energies = wp.zeros(len(elements), dtype=scalar, device=body.device)

    def take_moduli(self) -> None:
        assert self.elements is not None
        body = self.body
        factor = body.stiffness_factors if self.of_moduli else body.remaining_parts
        self._volume.assign((factor * body.mesh.volumes)[self.elements])
        self._stretch.assign(body.growth_stretches[self.elements])

    def _launch(self, kernel: Any, u: wp.array, *outputs: wp.array) -> None:
        body = self.body
        inputs = [
            self._elements,
            body.element_nodes,
            body.inverse_edges,
            self._volume,
            self._stretch,
            self._data,
            self.scale,
            u,
            *outputs,
        ]
        launch(kernel, len(self._elements), inputs, body.device)

    def evaluate_forces(self, u: wp.array) -> None:
        self._launch(self._kernels[0], u, self.forces)

    def evaluate_tangents(self, u: wp.array) -> None:
        self._launch(self._kernels[1], u, self.forces, self.blocks)

    def energy(self, u: wp.array) -> float:
        self._launch(self._kernels[2], u, self._energies)
        return float(np.sum(self._energies.numpy(), dtype=np.float64))
