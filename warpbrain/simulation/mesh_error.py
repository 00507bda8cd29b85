"""What the mesh gets wrong of a displacement: a comparison with elements that do not lock, and with smaller ones.

    E = L + M,   L = u'_h - u_h,   M = 4/3 (u'_(h/2) - u'_h)

`u_h` is the state, `u'_h` the same state of averaged gradients (`warpbrain.simulation.averaged`), which lock less, on
the same mesh, `u'_(h/2)` on elements of half the size. `L` is what locks; also what plain elements bend less well than
averaged ones. `M` is what is left of the error of averaged elements if it falls with the square of the size
(Richardson's extrapolation, with 2^2 / (2^2 - 1)). Of a state that is of averaged elements already `L` is zero.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.cases.boundary import Forced
from warpbrain.cases.case import Case
from warpbrain.errors import SolveError
from warpbrain.mesh import QuadraticMesh, TetMesh, node_areas, nodes_of
from warpbrain.mesh.refinement import finer_mesh
from warpbrain.physics.load import Load, NodalForce
from warpbrain.physics.mechanism import Removing
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Model, with_mechanisms
from warpbrain.simulation.observation import Observed, State, observe
from warpbrain.simulation.of_case import plain_model_of
from warpbrain.simulation.result import NodalState, Result, nodal_state_of
from warpbrain.simulation.system import System


@dataclass(frozen=True, kw_only=True, eq=False)
class GivenForces(Load):
    """Forces on the nodes of one mesh, and masses that they carry along."""

    forces: Floats  # (n, 3) [N]
    masses: Floats  # (n,) [kg]

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        return self.forces

    def nodal_masses(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        return self.masses


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
        #: (E, 2), ends of the edges in the middle of which the further nodes are.
        self.edges = ends[len(self._coarse.points) :]
        mechanisms = tuple(m for m in case.mechanisms if not isinstance(m, Removing))
        boundaries = tuple(b for b in case.boundaries if not isinstance(b, Forced))
        self.case = replace(case, mesh=mesh, mechanisms=mechanisms, boundaries=boundaries)

    def spread(self, forces: Floats) -> Floats:
        """Nodal forces (n', c) that act as those (n, c) on the mesh that there was do; masses are spread alike.

        A force on a node is taken for a load on the surface around it (in the volume, if a loaded node is inside),
        linear between nodes: the force over the node's share. On the finer mesh it is the same load, so that meshes of
        any size have one limit. Resultants stay: sums over shares are exact for functions linear in an element.
        """
        mesh = self.case.mesh
        if not forces.any():
            return np.zeros((len(mesh.points), forces.shape[1]))
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
            GivenForces(
                forces=self.spread(load.nodal_forces(model.mesh)),
                masses=self.spread(load.nodal_masses(model.mesh)[:, None])[:, 0],
                ramp=load.ramp,
            )
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


def restricted(prolong: Any, u: Floats, reactions: Floats) -> tuple[Floats, Floats]:
    """Displacement and reactions of the finer mesh at the nodes of the mesh that there was.

    A reaction between two nodes goes to both of them, so that resultants stay.
    """
    return u[: prolong.shape[1]], np.asarray(prolong.T @ reactions)


#: Out-of-balance force, relative: far below what meshes differ by.
TOLERANCE = 1e-5
#: Of an error that falls with the square of the size of elements, what halving them leaves to be added.
_RICHARDSON = 4.0 / 3.0


@dataclass(frozen=True, eq=False)
class MeshError:
    """An estimate of the error of a displacement: what is to be added to it."""

    locking: Floats  # (n, 3), `L` [m]
    size: Floats | None  # (n, 3), `M` [m]; None if no smaller elements were tried
    reactions: Floats  # (n, 3), the same of the reactions, both parts together [N]

    @property
    def u(self) -> Floats:
        """`E` [m], shape (n, 3)."""
        return self.locking if self.size is None else self.locking + self.size

    @property
    def locking_share(self) -> float:
        """How much of `E` is `L`: its projection, 0 to 1 if both point the same way; NaN without any error."""
        square = float(np.vdot(self.u, self.u))
        return float(np.vdot(self.locking, self.u)) / square if square > 0.0 else float("nan")


#: Finds the state again on other elements: their name, whether they are smaller, and where to start [m].
Solve = Callable[[str, bool, Floats], State]


def estimate(state: State, elements: str, solve: Solve, prolongation: Any = None) -> MeshError:
    """Estimate the error of a state on a kind of `elements`.

    Without a `prolongation` (n', n) to the finer mesh, see `FinerCase`, no smaller elements are tried. `SolveError` if
    a state is not found on other elements.
    """
    other = "tet4-averaged" if elements == "tet4" else elements
    free = state if other == elements else solve(other, False, state.u)
    locking, reactions = free.u - state.u, free.reactions - state.reactions
    if prolongation is None:
        return MeshError(locking, None, reactions)
    finer = solve(other, True, prolongation @ free.u)
    finer_u, finer_reactions = restricted(prolongation, finer.u, finer.reactions)
    size = _RICHARDSON * (finer_u - free.u)
    reactions = reactions + _RICHARDSON * (finer_reactions - free.reactions)
    return MeshError(locking, size, reactions)


def mesh_error(
    case: Case,
    model: Model,
    result: Result,
    *,
    smaller: bool = True,
    steps: int | None = None,
    device: str | None = None,
    on_share: Callable[[float, str], None] | None = None,
) -> MeshError:
    """Estimate the error of what was simulated of a case and its model.

    The result is an equilibrium or the end of a motion to rest; the end of a motion if `steps`, of 1 ms, says so. With
    `smaller` elements of half the size are tried, at about ten times the cost. `on_share` is called with the share of
    the present solve that is done, and what it is. `SolveError` if the state is not found on other elements.
    """
    finer = FinerCase(case) if smaller else None

    def solve(elements: str, small: bool, start: Floats) -> State:
        solved = replace(finer.model(model) if small and finer is not None else model, elements=elements)
        label = "half the size" if small else elements
        system = System(solved, device)

        def say(share: float) -> None:
            if on_share is not None:
                on_share(share, label)

        try:
            if steps is None:
                say(0.0)
                options = EquilibriumOptions(tolerance=TOLERANCE)
                found = EquilibriumSolver(system, options, lambda step: say(step.load)).solve(start=start)
                reactions = solved.reactions(found.internal, solved.external_forces())
                return NodalState(system.mesh, found.u, reactions)
            simulator = Simulator(system)
            for step in range(1, steps + 1):
                simulator.step_to(step / steps)
                say(step / steps)
            return nodal_state_of(system, simulator.time)
        except SolveError as error:
            raise SolveError(f"on elements {'of half the size' if small else elements}: {error}") from None

    return estimate(result, model.elements, solve, None if finer is None else finer.prolongation)


def observe_without(case: Case, result: Result, error: MeshError, time: float | None = None) -> Observed:
    """Recordings beside a state with the estimated error taken off; see `observe`."""
    return observe(case, NodalState(result.mesh, result.u + error.u, result.reactions + error.reactions), time)
