"""Unknown causes: smooth random fields of body force, eigenstress, traction and pressure, or tissue whose resistance
changes in time.

Each field is a sum of Gaussian patches with independent coefficients, a Gaussian process of that length. An eigenstress
`s` acts within the body: its nodal forces `-V s grad N` have no net force and no moment. Fluids, and what slides along
a surface, press on it alone: three components of a traction that are independent say little for that. The sensors see a
few modes of a field. These are dead loads, which fits follow as they follow mechanisms: with the response that a body
has without them, or with other tissue, they would explain what they do worse than a mechanism that does not act.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from warpbrain.arrays import Bools, Floats, Int32s
from warpbrain.inference.beliefs import belief
from warpbrain.mesh import QuadraticMesh, TetMesh, node_areas, node_vectors, nodes_of
from warpbrain.mesh.surface import edges_of
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import Proposal, modes_between
from warpbrain.physics.words import number
from warpbrain.threads import in_threads
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.linearisation import Linearisation, Moment, gathered
from warpbrain.worlds.body.sensors import row_products, spread_points
from warpbrain.worlds.body.time_courses import finite_times, modes_of, modes_of_rows

#: Components of a symmetric tensor.
_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


@dataclass(frozen=True, eq=False)
class Field:
    """A field without a name: what the sensors see of it in a few modes, and the nodal forces that these are.

    `forces`: from amplitudes (j, k) of its patches to nodal forces (N, 3, k) [N] on a mesh.
    """

    mesh: TetMesh  # which its columns are of
    columns: Floats  # (n, k), of each mode, all of them of 1 m root mean square over the recorded displacements
    modes: Floats  # (j, k), amplitudes of the patches in each mode
    forces: Callable[[TetMesh, Floats], Floats]

    def nodal_forces(self, mesh: TetMesh, coefficients: Floats) -> Floats:
        """Of modes with coefficients (k,), on any mesh of the body: (N, 3) [N]."""
        same = np.array_equal(mesh.tetrahedra, self.mesh.tetrahedra) and np.array_equal(mesh.points, self.mesh.points)
        # of the mesh of fits once, of a finer one, where they are needed once, for these coefficients alone
        forces = self._patterns @ coefficients if same else self.forces(mesh, self.modes @ coefficients[:, None])
        return np.asarray(forces.reshape(-1, 3))

    @cached_property
    def _patterns(self) -> Floats:
        """Nodal forces (N, 3, k) of each mode."""
        return self.forces(self.mesh, self.modes)


@dataclass(frozen=True, kw_only=True)
class UnknownLoad(Load, Mechanism):
    """A load without a name, which fits follow as they follow mechanisms; no case can declare it."""

    kind: ClassVar[str] = "unknown"
    sentence: ClassVar[str] = "Something without a name acts."
    example: ClassVar[str] = ""
    enters: ClassVar[Enters] = Enters("load", "f_unknown")
    several: ClassVar[bool] = True


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldLoad(UnknownLoad):
    """Modes of a field with coefficients (k,)."""

    field: Field
    coefficients: Floats

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> Floats:
        assert isinstance(mesh, TetMesh), "a diagnosis has linear elements"
        return self.field.nodal_forces(mesh, self.coefficients)


def declarable(mechanisms: Sequence[Mechanism]) -> tuple[Mechanism, ...]:
    """Those that a case can declare."""
    return tuple(mechanism for mechanism in mechanisms if not isinstance(mechanism, UnknownLoad))


def field_proposal(field: Field, size: float) -> Proposal:
    """A load of a field whose modes have a root mean square of `size` [m] together."""
    count = field.columns.shape[1]
    return Proposal(lambda c: FieldLoad(field=field, coefficients=c), np.zeros(count), np.full(count, size))


def force_patches(at: Linearisation, length: float, spacing: float | None = None) -> tuple[Floats, Floats]:
    """Sites (s, 3) [m], and answers (n, s, 3) to a force of 1 N in each direction, spread with a Gaussian."""
    mesh = at.system.model.mesh
    sites, weights, _ = _weights(mesh.points, mesh.points, mesh.node_volumes, length, spacing)
    return sites, at.answers_of_patches(weights)


def _weights(
    points: Floats, places: Floats, shares: Floats, length: float, spacing: float | None = None
) -> tuple[Floats, Floats, Floats]:
    """Sites (s, 3) [m], what nodes bear (N, s) of a force of 1 N about each, and amplitudes (s,) of these Gaussians.

    `places`: among which the sites are. `shares` (N,): of a uniform force.
    """
    sites = places[spread_points(places, length if spacing is None else spacing, 700)]
    weights = shares[:, None] * gaussians(points, sites, length)
    amplitudes = 1.0 / np.maximum(weights.sum(axis=0), 1e-300)
    return sites, weights * amplitudes, amplitudes


def body_forces(at: Linearisation, lengths: Sequence[float]) -> tuple[Field, ...]:
    """Body forces of each length [m]."""

    def shares(mesh: TetMesh) -> Floats:
        return np.asarray(mesh.node_volumes)

    # one after the other: the first one makes the compliance
    return tuple(_forces_on_nodes(at, at.system.model.mesh.points, length, shares) for length in lengths)


def tractions(at: Linearisation, length: float) -> Field:
    """Tractions of a length [m] on all that is free of the surface, which is not nothing."""
    faces = _free_faces(at)

    def shares(mesh: TetMesh) -> Floats:
        return node_areas(mesh.points, faces(mesh))

    return _forces_on_nodes(at, at.system.model.mesh.points[_free_of_surface(at)], length, shares)


def _forces_on_nodes(at: Linearisation, places: Floats, length: float, shares: Callable[[TetMesh], Floats]) -> Field:
    """Patches of forces in every direction; `shares`: those (N,) of the nodes of a mesh, see `_weights`."""
    mesh = at.system.model.mesh
    sites, weights, amplitudes = _weights(mesh.points, places, shares(mesh), length)

    def forces(mesh: TetMesh, coefficients: Floats) -> Floats:
        gaussian = shares(mesh)[:, None] * gaussians(mesh.points, sites, length) * amplitudes
        return np.asarray(gaussian @ coefficients.reshape(len(sites), -1)).reshape(len(gaussian), 3, -1)

    answers = at.answers_of_patches(weights)
    return _field(at, answers.reshape(len(answers), -1), forces)


def pressures(at: Linearisation, length: float) -> Field:
    """Pressures of a length [m] on what is free of the surface, which is not nothing."""
    points, faces = at.system.model.mesh.points, _free_faces(at)
    free = points[_free_of_surface(at)]
    sites = free[spread_points(free, length, 700)]

    def forces(mesh: TetMesh, coefficients: Floats) -> Floats:
        # each corner of a face bears a third of its load
        of_unit_pressure = node_vectors(mesh.points, faces(mesh)) / 3.0
        return of_unit_pressure[:, :, None] * (gaussians(mesh.points, sites, length) @ coefficients)[:, None]

    of_each = forces(at.system.model.mesh, np.eye(len(sites)))
    return _field(at, at.answers_of_columns(of_each.reshape(-1, len(sites))), forces)


def _free_of_surface(at: Linearisation) -> Bools:
    """Nodes (N,) on the surface that are not held."""
    mesh = at.system.model.mesh
    return np.asarray(nodes_of(mesh.boundary, len(mesh.points)) & at.system.movable)


def _free_faces(at: Linearisation) -> Callable[[TetMesh], Int32s]:
    """Faces (k, 3) of the surface of a mesh, or of it refined once, of which not all corners are held.

    What presses on the others goes straight into the support, which is no load on a body, but may have been recorded.
    """
    from scipy.spatial import cKDTree

    mesh, held = at.system.model.mesh, ~at.system.movable
    edges = edges_of(mesh.boundary)
    halves = mesh.points[edges[held[edges].all(axis=1)]].mean(axis=1)
    known = cKDTree(np.concatenate([mesh.points[held], halves]))

    def faces(other: TetMesh) -> Int32s:
        distance, _ = known.query(other.points, distance_upper_bound=1e-9 * mesh.radius)
        return np.asarray(other.boundary[np.isinf(distance)[other.boundary].any(axis=1)])

    return faces


def eigenstresses(at: Linearisation, length: float) -> Field:
    """Eigenstresses of a length [m], all six components."""
    mesh = at.system.model.mesh
    sites = mesh.centres[spread_points(mesh.centres, length, 700)]

    def forces(mesh: TetMesh, coefficients: Floats) -> Floats:
        heights, shape = gaussians(mesh.centres, sites, length), (len(mesh.points), len(mesh.tetrahedra))
        by_component = zip(unit_stresses_of(mesh), coefficients.reshape(6, len(sites), -1), strict=True)
        total = np.zeros((3 * shape[0], coefficients.shape[1]))
        for of_unit, of_sites in by_component:
            total -= gathered(mesh.tetrahedra, of_unit, np.arange(shape[1]), shape) @ (heights @ of_sites)
        return total.reshape(shape[0], 3, -1)

    return _field(at, stress_patches(at, mesh.points, sites, length), forces)


def root_mean_square(columns: Floats) -> float:
    """Of what all components (k) together move, over rows and places: of columns (n, k) or (n, k, s)."""
    return float(np.sqrt(np.mean(np.sum(columns**2, axis=1))))


def gaussians(points: Floats, sites: Floats, length: float) -> Floats:
    """Gaussians (m, s) of a length [m] about sites (s, 3) at points (m, 3) [m]."""
    from scipy.spatial.distance import cdist

    return np.asarray(np.exp(-0.5 * (cdist(points, sites) / length) ** 2))


def resistances(at: Linearisation, times: Sequence[float], volume: Proposal, smooth: Floats) -> Floats:
    """Columns (n, k) of tissues that resist more or less at one of several times [s] than at another.

    That is what relaxation, damage or healing does, whatever the law: under the same loads the body moves further
    or creeps back. The logarithm of each tissue's moduli has the modes of a course, and beside it that of the ratio of
    bulk and shear modulus of all of them. A smooth field, far smaller, stands for what is not linear.

    `volume`: of another Poisson ratio; its coefficient is a logarithm, too. `smooth` (n, j): of 1 m root mean
    square. No columns of one time, or where no known load acts.
    """
    nothing = np.zeros((len(at.sensors), 0))
    if len(times) < 2:
        return nothing
    mesh = at.system.model.mesh
    tissues = (mesh.tissue[:, None] == np.array(mesh.labels)).astype(np.float64)
    ends, modes = modes_of(times)

    def about(moment: Moment) -> Floats:
        state = moment.at
        courses = modes_between(ends, modes, finite_times(np.concatenate([times, moment.times]))[len(times) :])
        [bulk] = Effects(state).of([volume])
        columns = np.column_stack([state.answers_of_elements(state.element_forces, tissues), bulk.columns / volume.sd])
        # each with every course
        return row_products(columns, courses)

    columns = at.summed(about, "stiffness")
    columns = columns @ _visible_modes(columns, at.sensors.of_one_unit)
    # nothing that is known loads the body
    if not columns.any():
        return nothing
    not_linear = row_products(smooth, modes_of_rows(times, at.sensors))
    return np.column_stack([columns, belief("unknown.not_linear") * not_linear])


def stress_beside_held(at: Linearisation, length: float) -> Floats:
    """Columns (n, k) of patches of an eigenstress of a length [m] which what is held is a part of.

    What they exert on nodes that can move has a net force: held nodes carry its counterpart. Of 1 m root mean square.
    """
    from scipy.spatial import cKDTree

    model = at.system.model
    held = model.mesh.points[~at.system.movable]
    sites = model.mesh.centres[spread_points(model.mesh.centres, length, 700)]
    if not len(held):
        return np.zeros((len(at.sensors), 0))
    # two lengths away a patch has an eighth of its stress
    near = sites[cKDTree(held).query(sites)[0] < 2.0 * length]
    columns = stress_patches(at, model.mesh.points + at.u, near, length)
    rows = at.sensors.is_displacement
    size = root_mean_square(columns[rows]) if rows.any() and columns.size else 0.0
    return columns / size if size > 0.0 else np.zeros((len(at.sensors), 0))


def stress_patches(at: Linearisation, points: Floats, sites: Floats, length: float) -> Floats:
    """Response (n, 6 s) to each component of a stress of 1 Pa, spread about sites (s, 3) with a Gaussian.

    In elements whose nodes are at points (N, 3): where these are deformed a symmetric stress has no moment.
    """
    weights = gaussians(at.system.model.mesh.centres, sites, length)
    forces = unit_stresses(points[at.system.tetrahedra])
    return at.answers_of_components(forces, weights).reshape(len(at.sensors), -1)


def unit_stresses_of(mesh: TetMesh) -> Floats:
    """`unit_stresses` [N/Pa] of the elements of a mesh at rest (6, m, 4, 3), computed once for it."""
    return np.asarray(mesh.made_once("unit stresses", lambda: unit_stresses(mesh.points[mesh.tetrahedra])))


def unit_stresses(corners: Floats) -> Floats:
    """Internal forces (6, m, 4, 3) of stresses of 1 Pa (Frobenius) in elements with these corners (m, 4, 3)."""
    edges = corners[:, 1:] - corners[:, :1]
    volumes = np.abs(np.linalg.det(edges)) / 6.0
    gradients = np.linalg.inv(edges).transpose(0, 2, 1)
    shapes = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1) * volumes[:, None, None]
    forces = np.zeros((len(_PAIRS), *shapes.shape))
    for pair, (i, j) in enumerate(_PAIRS):
        # all of the same Frobenius norm, for isotropy
        forces[pair, :, :, i] += np.sqrt(0.5) * shapes[:, :, j]
        forces[pair, :, :, j] += np.sqrt(0.5) * shapes[:, :, i]
        if i == j:
            forces[pair] *= np.sqrt(0.5)
    return forces


def fields(at: Linearisation, lengths: Sequence[float], forces: Sequence[Field]) -> dict[str, Field]:
    """Every field by its name, body forces first. `lengths` [m]. `forces`: `body_forces` of these lengths."""
    # lengths in mm, in bodies of any size
    made: dict[str, Callable[[Linearisation, float], Field]] = {"eigenstress, {} mm": eigenstresses}
    if _free_of_surface(at).any():
        made |= {"traction, {} mm": tractions, "pressure, {} mm": pressures}
    each = [(words, length) for length in lengths for words in made]
    others = in_threads(lambda part: made[part[0]](at, part[1]), each)
    named = [*zip([("body force, {} mm", length) for length in lengths], forces, strict=True)]
    named += zip(each, others, strict=True)
    return {words.format(number(1e3 * length)): field for (words, length), field in named if field.columns.shape[1]}


def _field(at: Linearisation, answers: Floats, forces: Callable[[TetMesh, Floats], Floats]) -> Field:
    """The field of patches to which the sensors answer (n, j); see `Field`."""
    modes = _visible_modes(answers, at.sensors.of_one_unit)
    return Field(at.system.model.mesh, answers @ modes, modes, forces)


def _visible_modes(columns: Floats, rows: Bools) -> Floats:
    """Coefficients (j, k) of columns (n, j) in the modes that some of the rows (n,) see.

    Modes are in the order of their sizes, and all together of 1 m root mean square.
    """
    squares, vectors = np.linalg.eigh(columns[rows] @ columns[rows].T)
    sizes, vectors = np.sqrt(np.maximum(squares[::-1], 0.0)), vectors[:, ::-1]
    total = np.cumsum(sizes**2) / max(float(np.sum(sizes**2)), 1e-300)
    kept = min(int(np.searchsorted(total, 1.0 - belief("unknown.cut"))) + 1, int(belief("unknown.modes")))
    modes = columns[rows].T @ (vectors[:, :kept] / np.maximum(sizes[:kept], 1e-300))
    return np.asarray(modes / max(root_mean_square(columns[rows] @ modes), 1e-300))
