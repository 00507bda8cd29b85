"""What a load is: the base class of what acts on a body by forces on its nodes that do not follow it."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from warpbrain.mesh import QuadraticMesh, TetMesh
from warpbrain.physics.ramp import Ramped


@dataclass(frozen=True, kw_only=True)
class Load(Ramped, abc.ABC):
    """A dead load: forces that do not follow the deformation."""

    #: Whether `nodal_forces` knows what to do with midside nodes.
    quadratic: ClassVar[bool] = False
    #: Whether it acts on volume, so that the force on a node goes with the volume of tissue around it.
    by_volume: ClassVar[bool] = False

    @abc.abstractmethod
    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> NDArray[np.float64]:
        """Forces on the nodes at factor 1 [N], shape (n, 3)."""
