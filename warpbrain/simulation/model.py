"""A model: what is assumed about a body. Plain data, checked when made, independent of any device."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats, Int32s, Ints
from warpbrain.errors import InputError, require_kind
from warpbrain.mesh import QuadraticMesh, TetMesh, summed_at_nodes
from warpbrain.mesh.surface import connected
from warpbrain.physics.composition import require_composable
from warpbrain.physics.laws import Law
from warpbrain.physics.load import BodyForce, Load
from warpbrain.physics.mechanism import Emptying, Following, Growing, Mechanism, Removing, Substituting, Weakening

#: Kinds of elements; the default first.
ELEMENTS = ("tet4", "tet4-averaged", "tet10", "tet10-mixed")
#: Those with nodes in the middle of edges.
QUADRATIC = ("tet10", "tet10-mixed")


@dataclass(frozen=True)
class Material:
    """A law with its compressibility.

    Parameters
    ----------
    law : Law
    poisson : float
        Poisson ratio at rest, in (-1, 0.5).
    formulation : str
        ``"coupled"`` or ``"uncoupled"``; see `warpbrain.physics.laws.law`.
    """

    law: Law
    poisson: float = 0.45
    formulation: str = "coupled"

    def __post_init__(self) -> None:
        require_kind(self.law, Law, "law", "a Law, such as warpbrain.NeoHookean(mu=1000)")
        # refuses a bad Poisson ratio or formulation
        self.law.volumetric_modulus(self.poisson, self.formulation)

    @property
    def volumetric_modulus(self) -> float:
        """`lam` or `K` [Pa], by the formulation."""
        return self.law.volumetric_modulus(self.poisson, self.formulation)


@dataclass(frozen=True)
class Damping:
    """Rayleigh damping `D = stiffness K + mass M` (the paper's Table 4: 0.001 s and 0)."""

    stiffness: float = 0.001
    mass: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"damping: {name} = {value}: expected a number >= 0")


@dataclass(frozen=True, eq=False)
class Motion:
    """A displacement that some nodes are given over time."""

    nodes: Bools  # (n,), of the mesh's own nodes; midside nodes between them follow
    times: Floats  # (k,) [s], increasing
    values: Floats  # (k, 3) [m], linear between the times and constant outside them

    def at(self, time: float) -> Floats:
        """Displacement (3,) [m] at a time [s]."""
        return np.array([np.interp(time, self.times, component) for component in self.values.T])


@dataclass(frozen=True)
class Model:
    """Everything that is assumed to act on a body.

    Parameters
    ----------
    mesh : TetMesh
    materials : mapping of int to Material
        By tissue label; every label of the mesh must be there.
    density : float
        [kg/m3]
    constrained : (n, 3) bool array
        Components of the nodal displacements that are prescribed. With midside nodes either for every node, or for the
        mesh's own: then a component that all of these have is prescribed everywhere, and others on the midside nodes
        that belong to the set of nodes that have it (`warpbrain.mesh.refinement.inherited`).
    prescribed : (n, 3) array
        Their values [m] at full load; zero where not given, and the mean of its ends for a midside node.
    loads : sequence of Load
        Forces that do not follow the deformation.
    mechanisms : sequence of Mechanism
        What else acts, each a file of `warpbrain.physics.mechanisms`.
    motions : sequence of Motion
        Histories of prescribed displacements, which end at `prescribed`.
    damping : Damping
    elements : str
        One of `ELEMENTS`: plain linear tetrahedra, linear ones that lock less (`warpbrain.simulation.averaged`),
        quadratic ones with straight sides (`warpbrain.mesh.quadratic`), or these with a pressure of their own, which
        do not lock either (`warpbrain.simulation.mixed`).

    Raises
    ------
    InputError
        If a tissue has no material, an array has the wrong shape or holds NaN, the density is not positive, or
        something acts that the elements cannot have.
    CompositionError
        If two mechanisms have no meaning together.
    """

    mesh: TetMesh
    materials: Mapping[int, Material]
    density: float = 1211.5
    constrained: Bools = None  # type: ignore[assignment]  # nothing constrained
    prescribed: Floats = None  # type: ignore[assignment]  # zero
    loads: Sequence[Load] = ()
    mechanisms: Sequence[Mechanism] = ()
    motions: Sequence[Motion] = ()
    damping: Damping = field(default_factory=Damping)
    elements: str = "tet4"

    def __post_init__(self) -> None:
        if self.elements not in ELEMENTS:
            raise InputError(f"elements = {self.elements!r}: expected one of {', '.join(ELEMENTS)}")
        for name in unaware_of_midsides(self) if self.elements in QUADRATIC else ():
            raise InputError(
                f"{name}: cannot act on elements '{self.elements}', whose midside nodes it does not know: expected "
                "tet4 or tet4-averaged"
            )
        acting = [each for each in (*self.mechanisms, *self.loads) if isinstance(each, Mechanism)]
        require_composable(acting, self.mesh)
        shape = self.node_mesh.points.shape
        constrained = np.zeros(shape, dtype=bool) if self.constrained is None else np.asarray(self.constrained)
        prescribed = np.zeros(shape) if self.prescribed is None else np.asarray(self.prescribed, dtype=np.float64)
        if self.quadratic is not None:
            constrained, prescribed = _with_midsides(self.quadratic, constrained, prescribed)
        if constrained.dtype != bool or constrained.shape != shape:
            raise InputError(f"constrained: expected a boolean array of shape {shape}, found {constrained.shape}")
        if prescribed.shape != shape:
            raise InputError(f"prescribed: expected an array of shape {shape}, found {prescribed.shape}")
        if not np.all(np.isfinite(prescribed)):
            node = int(np.flatnonzero(~np.all(np.isfinite(prescribed), axis=1))[0])
            raise InputError(f"prescribed: the displacement of node {node} is not finite")
        if np.any(prescribed[~constrained] != 0.0):
            raise InputError("prescribed: a component that is not constrained has a displacement")
        if not (math.isfinite(self.density) and self.density > 0.0):
            raise InputError(f"density = {self.density:g} kg/m3: expected a positive number")
        self._require_materials()
        object.__setattr__(self, "constrained", constrained)
        object.__setattr__(self, "prescribed", prescribed)

    def with_materials(self, materials: Mapping[int, Material]) -> Model:
        """The model of other tissue: materials by label, before its mechanisms say what law or compressibility it has.

        Nothing that is known of the model is found again. `InputError` if a tissue has no material.
        """
        model: Model = object.__new__(Model)
        model.__dict__.update(vars(self), materials=all_substituted(materials, self.mechanisms))
        model._require_materials()
        return model

    def _require_materials(self) -> None:
        missing = sorted(set(self.mesh.labels) - set(self.materials))
        if missing:
            raise InputError(f"materials: no material for tissue {', '.join(map(str, missing))} of the mesh")

    @cached_property
    def quadratic(self) -> QuadraticMesh | None:
        """The mesh with midside nodes; None if elements have none."""
        return QuadraticMesh(self.mesh) if self.elements in QUADRATIC else None

    @property
    def node_mesh(self) -> TetMesh:
        """Linear tetrahedra with a corner at every node: the mesh, or its elements cut into eight."""
        return self.mesh if self.quadratic is None else self.quadratic.node_mesh

    def reactions(self, internal: Floats, external: Floats, nodes: slice | NDArray[np.intp] = slice(None)) -> Floats:
        """What holds the constrained components [N], zero elsewhere, of internal and external forces (..., n, 3).

        `nodes` says which nodes these forces are of; all if nothing is said.
        """
        return np.where(self.constrained[nodes], internal - external, 0.0)

    def prescribed_at(self, time: float, share: float) -> Floats:
        """Prescribed displacements (n, 3) [m] at a time [s]; a `share` of those that have no history."""
        displacement = share * self.prescribed
        corners = displacement[: len(self.mesh.points)]
        moved: Bools = np.zeros(len(corners), dtype=bool)
        for motion in self.motions:
            corners[motion.nodes] = motion.at(time)
            moved[motion.nodes] = True
        if self.quadratic is not None and self.motions:
            follows = self.constrained & np.any(moved[self.quadratic.ends], axis=1, keepdims=True)
            displacement[follows] = self.quadratic.between(corners)[follows]
        return displacement

    @property
    def node_masses(self) -> Floats:
        """Lumped mass of each node [kg], shape (n,), positive, before any tissue is taken out little by little; with
        what hangs there (`Load.nodal_masses`).
        """
        nodes = self.quadratic or self.mesh
        return self.density * nodes.node_volumes + sum(load.nodal_masses(nodes) for load in self.loads)

    @cached_property
    def emptying(self) -> list[Emptying]:
        """The mechanisms that take tissue out little by little."""
        return [mechanism for mechanism in self.mechanisms if isinstance(mechanism, Emptying)]

    @cached_property
    def growing(self) -> list[Growing]:
        """The mechanisms by which tissue grows."""
        return [mechanism for mechanism in self.mechanisms if isinstance(mechanism, Growing)]

    @cached_property
    def weakening(self) -> list[Weakening]:
        """The mechanisms that make tissue softer."""
        return [mechanism for mechanism in self.mechanisms if isinstance(mechanism, Weakening)]

    def remaining_part(self, scales: Sequence[float]) -> Floats:
        """Part (m,) of each tetrahedron that is left, with a scale from 0 to 1 for each of `emptying`."""
        part = np.ones(len(self.mesh.tetrahedra))
        for mechanism, scale in zip(self.emptying, scales, strict=True):
            part *= mechanism.remaining_part(self.mesh, scale)
        return part

    @cached_property
    def element_kinds(self) -> Ints:
        """Number (m,) by which elements are alike that are of one tissue and are taken out by the same mechanisms.

        A mean over elements of several kinds would hold the wall of a cavity, however little of it is left.
        """
        parts = [mechanism.remaining_part(self.mesh, 1.0) for mechanism in self.emptying]
        rows = np.stack([self.mesh.tissue.astype(np.float64), *parts], axis=1)
        return np.asarray(np.unique(rows, axis=0, return_inverse=True)[1].ravel(), dtype=np.int64)

    def remaining_share(self, scales: Sequence[float]) -> Floats:
        """Share (n,) of the volume around each node that is left, with a scale from 0 to 1 for each of `emptying`."""
        if not self.emptying:
            return np.ones(len(self.constrained))
        nodes = self.quadratic or self.mesh
        return np.asarray(nodes.lumped(self.remaining_part(scales) * self.mesh.volumes) / nodes.node_volumes)

    @property
    def mass(self) -> float:
        """[kg]"""
        return self.density * self.mesh.volume

    @cached_property
    def unit_forces(self) -> list[Floats]:
        """What each load does at factor 1 [N], `Load.unit_forces`; loads are dead, so it is computed once."""
        return [load.unit_forces(self.quadratic or self.mesh) for load in self.loads]

    def external_forces(self, time: float = math.inf, unit_forces: Sequence[Floats] | None = None) -> Floats:
        """Sum of the loads on the nodes [N], shape (n, 3); tissue that has been taken out by then weighs nothing.

        Parameters
        ----------
        time : float
            [s]; by default long after every ramp.
        unit_forces : sequence of arrays, optional
            Others in the place of `unit_forces`, such as their derivatives.
        """
        total = np.zeros(self.constrained.shape)
        if unit_forces is None and not self.emptying:
            at_nodes = self._whole_forces
        else:
            part = self.remaining_part([mechanism.factor(time) for mechanism in self.emptying])
            nodes = self.quadratic or self.mesh
            at_nodes = [
                summed_at_nodes(nodes, part[:, None, None] * forces) if isinstance(load, BodyForce) else forces
                for load, forces in zip(self.loads, unit_forces or self.unit_forces, strict=True)
            ]
        for load, forces in zip(self.loads, at_nodes, strict=True):
            total += load.factor(time) * forces
        return total

    @cached_property
    def _whole_forces(self) -> list[Floats]:
        """Nodal forces (n, 3) [N] of each load at factor 1 on all of the tissue, for every step of a motion."""
        return [load.nodal_forces(self.quadratic or self.mesh) for load in self.loads]


def unaware_of_midsides(model: Model) -> list[str]:
    """Names of what acts and cannot act on elements with midside nodes."""
    following = [m for m in model.mechanisms if isinstance(m, Following)]
    acting: list[Load | Mechanism] = [*model.loads, *following]
    return [getattr(each, "kind", type(each).__name__) for each in acting if not each.quadratic]


def _with_midsides(mesh: QuadraticMesh, constrained: Bools, prescribed: Floats) -> tuple[Bools, Floats]:
    """Constraints and their values, where they are given for corners only, for midside nodes too."""
    corners = mesh.corners.points.shape
    if constrained.shape == corners and constrained.dtype == bool:
        columns = [np.ones(len(mesh.ends), dtype=bool) if c.all() else mesh.inherited(c) for c in constrained.T]
        constrained = np.stack(columns, axis=1)
    if prescribed.shape == corners and constrained.shape == mesh.points.shape:
        prescribed = np.where(constrained, mesh.between(prescribed), 0.0)
    return constrained, prescribed


def with_mechanisms(model: Model, mechanisms: Sequence[Mechanism]) -> Model:
    """The model with mechanisms that act too.

    Those that are loads go to the loads, those that say another law or compressibility change the materials, in their
    order, and all others act in the system. With other numbers of the same mechanisms (`with_numbers`) the model is one
    that `System.set_model` takes. If tissue is removed, it is of what is left.
    """
    loads = [m for m in mechanisms if isinstance(m, Load)]
    materials = all_substituted(model.materials, mechanisms)
    acting = [m for m in mechanisms if not isinstance(m, Removing | Load)]
    return replace(model, materials=materials, loads=(*loads, *model.loads), mechanisms=(*acting, *model.mechanisms))


def all_substituted(materials: Mapping[int, Material], mechanisms: Sequence[Mechanism]) -> dict[int, Material]:
    """The materials of tissues as those mechanisms that say something of their law have them, in their order."""
    substitutes = dict(materials)
    for mechanism in mechanisms:
        if isinstance(mechanism, Substituting):
            substitutes = substituted(substitutes, mechanism)
    return substitutes


def substituted(materials: Mapping[int, Material], mechanism: Substituting) -> dict[int, Material]:
    """The materials of tissues as a mechanism that says something of their law has them."""
    return {
        label: Material(*mechanism.substitute(label, m.law, m.poisson, m.formulation)) for label, m in materials.items()
    }


def require_held(model: Model) -> None:
    """Raise `InputError` if a connected part of the body can move as a rigid one.

    Each part needs constrained components, or mechanisms that hold it, that exclude its six rigid motions.
    """
    mesh = model.node_mesh
    count = len(mesh.points)
    parts, part = _connected_parts(mesh)
    holding = [mechanism.held(mesh) for mechanism in model.mechanisms]
    for number in range(parts):
        members = np.flatnonzero(part == number)
        x = mesh.points[members] - mesh.points[members].mean(axis=0)
        size = float(np.abs(x).max())
        # three translations and three rotations of each node: (node, component, motion)
        turns = np.cross(np.eye(3)[:, None], x / size).transpose(1, 2, 0)
        motions = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=2)
        held = motions[model.constrained[members]]
        for nodes, directions in holding:
            inside = np.isin(nodes, members)
            rows = motions[np.searchsorted(members, nodes[inside])]
            held = np.concatenate([held, np.einsum("ki,kij->kj", directions[inside], rows)])
        rank = int(np.linalg.matrix_rank(held, tol=1e-6)) if len(held) else 0
        if rank < 6:
            where = 1000.0 * mesh.points[members].mean(axis=0)
            which = "the body" if parts == 1 else f"a part of {len(members)} of {count} nodes"
            raise InputError(
                f"{which} around ({where[0]:.0f}, {where[1]:.0f}, {where[2]:.0f}) mm is not held: its constrained "
                f"nodes leave {6 - rank} of 6 rigid motions free, so it has no equilibrium"
            )


@lru_cache(maxsize=4)
def _connected_parts(mesh: TetMesh) -> tuple[int, Int32s]:
    """How many there are, and which of them each node (n,) belongs to; a mesh is asked for every state of it."""
    links = np.column_stack([np.repeat(mesh.tetrahedra[:, 0], 3), mesh.tetrahedra[:, 1:].ravel()])
    part = connected(links, len(mesh.points))
    return int(part.max()) + 1, part
