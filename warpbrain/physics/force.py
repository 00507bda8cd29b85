"""A total force shared by the nodes of a set: the 10 N on the superior cap of the phantom."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.mesh import QuadraticMesh, TetMesh
from warpbrain.physics.load import Load


@dataclass(frozen=True, kw_only=True)
class NodalForce(Load):
    """A force divided evenly among the nodes of a set.

    Parameters
    ----------
    nodes : str
        Name of the node set.
    total : tuple of three floats
        Total force [N]; each of the k nodes of the set carries ``total / k``, midside nodes like corners.

    Raises
    ------
    InputError
        If the total is not finite; by `nodal_forces`, if the mesh has no such set or it is empty.
    """

    nodes: str
    total: tuple[float, float, float]
    quadratic: ClassVar[bool] = True
    sentence: ClassVar[str] = "A force presses on part of the surface."

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.total) != 3 or not np.all(np.isfinite(self.total)):
            raise InputError(f"force on '{self.nodes}': total = {self.total}: expected three finite numbers [N]")

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        members = mesh.node_sets.get(self.nodes)
        if members is None:
            raise InputError(
                f"force: the mesh has no node set '{self.nodes}' (it has {', '.join(sorted(mesh.node_sets)) or 'none'})"
            )
        if not members.any():
            raise InputError(f"force: node set '{self.nodes}' is empty")
        forces = np.zeros(mesh.points.shape)
        forces[members] = np.asarray(self.total, dtype=float) / members.sum()
        return forces
