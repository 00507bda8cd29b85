"""What a simulation says: displacement, strain and stress as plain named arrays with units."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import require_kind
from warpbrain.mesh import TetMesh
from warpbrain.shown import Shown
from warpbrain.simulation.system import System


@dataclass(frozen=True)
class Statistics:
    """Size of the displacements of some nodes [m]."""

    nodes: int
    mean: float
    root_mean_square: float
    percentile_95: float
    largest: float


@dataclass(frozen=True)
class NodalState:
    """The state of all nodes, midside nodes among them: what recordings are compared with."""

    mesh: TetMesh  # linear tetrahedra with a corner at every node, undeformed
    u: Floats  # (n, 3), as those of `Result`
    reactions: Floats  # (n, 3), as those of `Result`


@dataclass(frozen=True)
class Result(Shown):
    """The state of a body.

    Attributes
    ----------
    mesh : TetMesh
        The simulated mesh, undeformed.
    u : (n, 3) array
        Displacement [m].
    J : (m,) array
        Volume ratio of each element.
    principal_stretches : (m, 3) array
        Descending.
    von_mises, pressure : (m,) array
        Of the Cauchy stress [Pa]; pressure is positive in compression.
    reactions : (n, 3) array
        What holds the constrained components [N]: their internal forces less the loads that act on them; zero
        elsewhere.
    nodal_pressures : mapping of str to (n,) array
        What mechanisms know at the nodes [Pa]: ``fluid_pressure`` of drainage.
    u_middles : (m, 6, 3) array or None
        Displacement [m] of the midside nodes of quadratic elements, in the order of `warpbrain.mesh.surface.EDGES`.

    Of quadratic elements displacements are those of the mesh's own nodes, strain and stress those in the middle of
    elements, and half of what holds a midside node is at either end of its edge.
    """

    mesh: TetMesh
    u: Floats
    J: Floats
    principal_stretches: Floats
    von_mises: Floats
    pressure: Floats
    reactions: Floats
    nodal_pressures: Mapping[str, Floats] = field(default_factory=dict)
    u_middles: Floats | None = None

    def displacement_statistics(self) -> Mapping[str, Statistics]:
        """Statistics of the displacement by node set, and of all nodes under ``"all nodes"``."""
        return displacement_statistics(self.mesh, self.u)


def displacement_statistics(mesh: TetMesh, u: Floats) -> Mapping[str, Statistics]:
    """Statistics of a displacement (n, 3) [m] by node set, and of all nodes under ``"all nodes"``."""
    sizes = np.linalg.norm(u, axis=1)
    groups = {"all nodes": np.ones(len(sizes), dtype=bool), **mesh.node_sets}
    return {
        name: Statistics(
            nodes=len(lengths),
            mean=float(lengths.mean()),
            root_mean_square=float(np.sqrt(np.mean(lengths**2))),
            percentile_95=float(np.percentile(lengths, 95.0)),
            largest=float(lengths.max()),
        )
        for name, members in groups.items()
        if len(lengths := sizes[members])
    }


def nodal_state_of(system: System, time: float = math.inf) -> NodalState:
    """The state of all nodes of a system at its present displacement; see `result_of`."""
    internal = system.internal_forces()
    reactions = system.model.reactions(internal, system.model.external_forces(time))
    return NodalState(system.node_mesh, system.u.numpy().astype(np.float64), reactions)


def result_of(system: System, time: float = math.inf) -> Result:
    """Evaluate a system at its present displacement.

    Parameters
    ----------
    system : System
    time : float
        Of the state [s], for loads with a ramp; by default long after every one.
    """
    require_kind(system, System, "system", "a System, as warpbrain.System(model) gives")
    state = nodal_state_of(system, time)
    F = system.deformation_gradients()
    J = np.linalg.det(F)
    cauchy = system.stresses() @ F.transpose(0, 2, 1) / J[:, None, None]
    pressure = -np.trace(cauchy, axis1=1, axis2=2) / 3.0
    deviator = cauchy + pressure[:, None, None] * np.eye(3)
    u, reactions = state.u, state.reactions
    u_middles = None
    if system.quadratic is not None:
        u_middles = system.quadratic.at_middles(u)
        u, reactions = u[: len(system.mesh.points)], system.quadratic.at_corners(reactions)
    return Result(
        mesh=system.mesh,
        u=u,
        J=J,
        principal_stretches=np.asarray(np.linalg.svd(F, compute_uv=False), dtype=np.float64),
        von_mises=np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2))),
        pressure=pressure,
        reactions=reactions,
        nodal_pressures={name: p for term in system.terms for name, p in term.nodal_pressures().items()},
        u_middles=u_middles,
    )
