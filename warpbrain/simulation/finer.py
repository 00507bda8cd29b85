"""A case on elements of half the size: the same body, the same assumptions, the same loads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats
from warpbrain.cases.boundary import Forced
from warpbrain.cases.case import Case
from warpbrain.mesh import QuadraticMesh, TetMesh, node_areas, nodes_of
from warpbrain.mesh.refinement import finer_mesh
from warpbrain.physics.load import Load, NodalForce
from warpbrain.physics.mechanism import Removing
from warpbrain.simulation.model import Model, with_mechanisms
from warpbrain.simulation.of_case import plain_model_of


@dataclass(frozen=True, kw_only=True, eq=False)
class GivenForces(Load):
    """Forces on the nodes of one mesh."""

    forces: Floats  # (n, 3) [N]

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        return self.forces


class FinerCase:
    """A case with every element cut into eight.

    `case` is then without its resection, which is done already, and without forces that are shared by nodes: see
    `spread`. `prolongation`, SciPy sparse (n', n), is from nodal values of the mesh that there was to those on the
    finer one; linear in every old element.
    """

    def __init__(self, case: Case) -> None:
        self._coarse, _ = case.remaining
        mesh, ends = finer_mesh(self._coarse)
        self.prolongation = prolongation(ends, len(self._coarse.points))
        mechanisms = tuple(m for m in case.mechanisms if not isinstance(m, Removing))
        boundaries = tuple(b for b in case.boundaries if not isinstance(b, Forced))
        self.case = replace(case, mesh=mesh, mechanisms=mechanisms, boundaries=boundaries)

    def spread(self, forces: Floats) -> Floats:
        """Nodal forces (n', 3) that act as those (n, 3) on the mesh that there was do.

        A force on a node is taken for a load on the surface around it (in the volume, if a loaded node is inside),
        linear between nodes: the force over the node's share. On the finer mesh it is the same load, so that meshes of
        any size have one limit. Resultants stay: sums over shares are exact for functions linear in an element.
        """
        mesh = self.case.mesh
        if not forces.any():
            return np.zeros(mesh.points.shape)
        loaded = forces.any(axis=1)
        if nodes_of(self._coarse.boundary, len(self._coarse.points))[loaded].all():
            coarse, fine = (node_areas(each.points, each.boundary) for each in (self._coarse, mesh))
        else:
            coarse, fine = self._coarse.node_volumes, mesh.node_volumes
        density = np.zeros_like(forces)
        density[loaded] = forces[loaded] / coarse[loaded, None]
        return np.asarray(fine[:, None] * (self.prolongation @ density))

    def model(self, model: Model) -> Model:
        """The finer model of what `model_of` makes of the case, with the same elements."""
        plain = self._plain
        shared = [
            GivenForces(forces=self.spread(load.nodal_forces(model.mesh)), ramp=load.ramp)
            for load in model.loads
            if isinstance(load, NodalForce)
        ]
        loaded = replace(plain, loads=[*plain.loads, *shared], elements=model.elements)
        return with_mechanisms(loaded, self.case.mechanisms)

    @cached_property
    def _plain(self) -> Model:
        """Without mechanisms."""
        return plain_model_of(self.case)


def prolongation(ends: NDArray[np.integer], count: int) -> Any:
    """Sparse matrix (n', n) of the means of the two `count` old nodes that each new one lies between; see `refined`."""
    from scipy.sparse import csr_matrix

    rows = np.repeat(np.arange(len(ends)), 2)
    return csr_matrix((np.full(2 * len(ends), 0.5), (rows, ends.ravel())), shape=(len(ends), count))


def free_prolongation(prolong: Any, free: Bools, constrained: Bools) -> Any:
    """From free components (3 n,) of a mesh to all of the finer one: SciPy CSR (3 n', k), zero where these (n', 3) are
    constrained; for `prolong` see `prolongation`.
    """
    from scipy.sparse import diags_array, eye_array, kron

    by_component = kron(prolong, eye_array(3), format="csr")[:, free]
    return (diags_array((~constrained.ravel()).astype(np.float64)) @ by_component).tocsr()


def restricted(prolong: Any, u: Floats, reactions: Floats) -> tuple[Floats, Floats]:
    """Displacement and reactions of the finer mesh at the nodes of the mesh that there was.

    A reaction between two nodes goes to both of them, so that resultants stay.
    """
    return u[: prolong.shape[1]], np.asarray(prolong.T @ reactions)
