"""What acts with a factor over time, and a load: forces on the nodes of a body that do not follow it."""

import abc
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import InputError
from warpbrain.mesh import QuadraticMesh, TetMesh, summed_at_nodes

#: The derivative, along a path of loads, of what a function finds for each load on it.
Along = Callable[[Callable[[Any], Floats]], Floats]
#: Rounding of factors that users write.
_ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True)
class Ramped:
    """Something that acts with a factor over time."""

    #: Factor over time [s], linear between the points and constant outside them; 1 if empty
    ramp: Sequence[tuple[float, float]] = field(default=())

    def __post_init__(self) -> None:
        times = [t for t, _ in self.ramp]
        if not np.all(np.isfinite(np.asarray(self.ramp, dtype=float))):
            raise InputError(f"ramp = {list(self.ramp)}: times and factors must be finite")
        if any(b <= a for a, b in itertools.pairwise(times)):
            raise InputError(f"ramp = {list(self.ramp)}: times must increase")

    def factor(self, time: float = math.inf) -> float:
        """The ramp's factor at a time [s]; by default long after everything."""
        if not self.ramp:
            return 1.0
        times, factors = zip(*self.ramp, strict=True)
        return float(np.interp(time, times, factors))


def take_turns(ramped: Sequence[Ramped]) -> bool:
    """Whether they are together no more than one of them in full: their factors add up to 1, or the largest of all."""
    # a sum of absolute values of linear functions is largest at an end of a piece
    times = sorted({time for each in ramped for time, _ in each.ramp})
    sizes = np.array([[abs(each.factor(time)) for each in ramped] for time in (*times, math.inf)])
    return bool(sizes.sum(axis=1).max() <= max(1.0, float(sizes.max())) * (1.0 + _ROUNDING))


#: What a mechanism adds or changes.
Changed = Literal["loads", "stiffness", "volumes"]


@dataclass(frozen=True, kw_only=True)
class Load(Ramped, abc.ABC):
    """A dead load: forces that do not follow the deformation."""

    changes: ClassVar[Changed] = "loads"
    #: Whether `nodal_forces` knows what to do with midside nodes.
    quadratic: ClassVar[bool] = False

    @abc.abstractmethod
    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        """Forces on the nodes at factor 1 [N], shape (n, 3)."""

    def unit_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        """What `Model.external_forces` sums up of it: forces at factor 1 [N], on nodes (n, 3)."""
        return self.nodal_forces(mesh)

    def nodal_masses(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        """Masses [kg] that the nodes carry along beside the tissue's, shape (n,)."""
        return np.zeros(len(mesh.points))

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


@dataclass(frozen=True, kw_only=True)
class NodalForce(Load):
    """A force divided evenly among the nodes of a set.

    Parameters
    ----------
    nodes : str
        Name of the node set.
    total : tuple of three floats
        Total force [N]; each of the k nodes of the set carries ``total / k``, midside nodes like corners.
    mass : float
        Of what pulls [kg], if that moves with the nodes, in all directions: each carries ``mass / k`` along. Its weight
        is part of the total.

    Raises
    ------
    InputError
        If the total is not finite or the mass negative; by `nodal_forces`, if the mesh has no such set or it is empty.
    """

    nodes: str
    total: tuple[float, float, float]
    mass: float = 0.0
    quadratic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.total) != 3 or not np.all(np.isfinite(self.total)):
            raise InputError(f"force on '{self.nodes}': total = {self.total}: expected three finite numbers [N]")
        if not (math.isfinite(self.mass) and self.mass >= 0.0):
            raise InputError(f"force on '{self.nodes}': mass = {self.mass}: expected a number >= 0 [kg]")

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        members = self._members(mesh)
        forces = np.zeros(mesh.points.shape)
        forces[members] = np.asarray(self.total, dtype=float) / members.sum()
        return forces

    def nodal_masses(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        members = self._members(mesh)
        return np.asarray(self.mass * members / members.sum())

    def _members(self, mesh: TetMesh | QuadraticMesh) -> Bools:
        members = mesh.node_sets.get(self.nodes)
        if members is None:
            raise InputError(
                f"force: the mesh has no node set '{self.nodes}' (it has {', '.join(sorted(mesh.node_sets)) or 'none'})"
            )
        if not members.any():
            raise InputError(f"force: node set '{self.nodes}' is empty")
        return members
