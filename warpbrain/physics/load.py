"""What a load is: the base class of what acts on a body by forces on its nodes that do not follow it."""

from __future__ import annotations

import abc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from warpbrain.mesh import QuadraticMesh, TetMesh, summed_at_nodes
from warpbrain.physics.ramp import Ramped

Floats = NDArray[np.float64]
#: The derivative, along a path of loads, of what a function finds for each load on it.
Along = Callable[[Callable[[Any], Floats]], Floats]


@dataclass(frozen=True, kw_only=True)
class Load(Ramped, abc.ABC):
    """A dead load: forces that do not follow the deformation."""

    #: Whether `nodal_forces` knows what to do with midside nodes.
    quadratic: ClassVar[bool] = False

    @abc.abstractmethod
    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        """Forces on the nodes at factor 1 [N], shape (n, 3)."""

    def unit_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        """What `Model.external_forces` sums up of it: forces at factor 1 [N], on nodes (n, 3)."""
        return self.nodal_forces(mesh)

    def unit_forces_rate(self, mesh: TetMesh | QuadraticMesh, along: Along) -> Floats:
        """Derivative of `unit_forces` along a path of loads that begins here, by differences unless overridden.

        `along` differentiates any smooth function of a load along the path, such as a parameter.
        """
        return along(lambda load: load.unit_forces(mesh))


@dataclass(frozen=True, kw_only=True)
class BodyForce(Load):
    """A load on the volume: what is taken out of a body takes its share of the force with it."""

    @abc.abstractmethod
    def unit_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        """Forces at factor 1 [N] on the nodes of each tetrahedron, (m, 4, 3) or (m, 10, 3)."""

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        return summed_at_nodes(mesh, self.unit_forces(mesh))
