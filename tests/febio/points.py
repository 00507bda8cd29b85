"""warpbrain's materials at material points: each point is a tetrahedron of its own, with a given gradient.

A unit tetrahedron of volume 1/6 has the shape functions' gradients `e_1, e_2, e_3` at nodes 1 to 3, so that its nodal
forces and tangent blocks, of the law and of everything that is added to it, are `P` and `dP/dF` times the volume.
"""

import numpy as np
from bodies import matrix_of

from febio.materials import Constitution
from febio.problem import Floats
from warpbrain.mesh import TetMesh
from warpbrain.simulation.model import Model
from warpbrain.simulation.system import System

_CORNERS = np.vstack([np.zeros(3), np.eye(3)])
_VOLUME = 1.0 / 6.0


class Points:
    """A number of material points of one material."""

    def __init__(self, constitution: Constitution, count: int, device: str) -> None:
        offsets = 2.0 * np.stack([np.arange(count), np.zeros(count), np.zeros(count)], axis=1)
        self.corners = (_CORNERS[None] + offsets[:, None]).reshape(-1, 3)
        mesh = TetMesh(self.corners, np.arange(4 * count).reshape(-1, 4))
        model = Model(mesh, {1: constitution.material}, mechanisms=constitution.mechanisms)
        self.count = count
        self.system = System(model, device)
        self.system.set_load()

    def evaluate(self, F: Floats) -> tuple[Floats, Floats]:
        """`P` (k, 3, 3) and `dP_ij/dF_kl` (k, 3, 3, 3, 3) at gradients (k, 3, 3)."""
        u = np.zeros((self.count, 4, 3))
        u[:, 1:] = np.swapaxes(F - np.eye(3), 1, 2)
        system = self.system
        system.u.assign(u.reshape(-1, 3))
        system.evaluate_tangents()
        system.gather_forces()
        system.assemble(1.0, 0.0)
        forces = system.internal.numpy().reshape(self.count, 4, 3)
        P = np.swapaxes(forces[:, 1:], 1, 2) / _VOLUME
        K = matrix_of(system)
        rows = np.repeat(np.arange(4 * self.count), np.diff(K.indptr))
        blocks = np.zeros((self.count, 4, 4, 3, 3))
        blocks[rows // 4, rows % 4, K.indices % 4] = K.data
        return P, np.transpose(blocks[:, 1:, 1:], (0, 3, 1, 4, 2)) / _VOLUME
