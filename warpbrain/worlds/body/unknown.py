"""Unknown causes as columns over sensors: smooth random fields of body force, eigenstress, traction and pressure,
or tissue whose resistance changes in time.

Each field is a sum of Gaussian patches with independent coefficients, a Gaussian process of that length. An eigenstress
`s` acts within the body: its nodal forces `-V s grad N` have no net force and no moment. Fluids, and what slides along
a surface, press on it alone: three components of a traction that are independent say little for that. Columns are of
1 m root mean square over the recorded displacements, truncated to the modes that the sensors see.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.inference.beliefs import belief
from warpbrain.mesh import node_areas, node_vectors, nodes_of
from warpbrain.physics.proposal import Proposal, modes_between
from warpbrain.physics.words import number
from warpbrain.threads import in_threads
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.linearisation import Linearisation, Moment
from warpbrain.worlds.body.sensors import spread_points
from warpbrain.worlds.body.time_courses import finite_times, modes_of, modes_of_rows, with_courses

#: Components of a symmetric tensor.
_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def force_patches(at: Linearisation, length: float, spacing: float | None = None) -> tuple[Floats, Floats]:
    """Sites (s, 3) [m], and answers (n, s, 3) to a force of 1 N in each direction, spread with a Gaussian."""
    mesh = at.system.model.mesh
    return _patches(at, mesh.points, mesh.node_volumes, length, spacing)


def _patches(
    at: Linearisation, places: Floats, shares: Floats, length: float, spacing: float | None
) -> tuple[Floats, Floats]:
    sites, weights = _weights(at, places, shares, length, spacing)
    # the share on held nodes moves nothing
    weights /= np.maximum(weights.sum(axis=0), 1e-300)
    return sites, at.answers_of_patches(weights)


def _weights(
    at: Linearisation, places: Floats, shares: Floats, length: float, spacing: float | None = None
) -> tuple[Floats, Floats]:
    """Sites (s, 3) [m], and Gaussians (N, s) about them at the nodes, of height 1, times the shares of nodes (N,)."""
    points = at.system.model.mesh.points
    sites = places[spread_points(places, length if spacing is None else spacing, 700)]
    return sites, shares[:, None] * gaussians(points, sites, length)


def body_forces(at: Linearisation, lengths: Sequence[float]) -> tuple[Floats, ...]:
    """Columns (n, k) of a body force of each length [m]."""
    answers = [force_patches(at, length)[1] for length in lengths]
    rows = at.sensors.is_displacement
    return tuple(in_threads(lambda answer: _visible_modes(answer.reshape(len(answer), -1), rows), answers))


def tractions(at: Linearisation, length: float) -> Floats:
    """Columns (n, k) of a traction of a length [m] on all that is free of the surface, which is not nothing."""
    mesh, free = at.system.model.mesh, _free_of_surface(at)
    shares = np.where(free, node_areas(mesh.points, mesh.boundary), 0.0)
    _, answers = _patches(at, mesh.points[free], shares, length, None)
    return _visible_modes(answers.reshape(len(answers), -1), at.sensors.is_displacement)


def pressures(at: Linearisation, length: float) -> Floats:
    """Columns (n, k) of a pressure of a length [m] on what is free of the deformed surface, which is not nothing."""
    mesh, free = at.system.model.mesh, _free_of_surface(at)
    _, weights = _weights(at, mesh.points[free], free.astype(np.float64), length)
    # each corner of a face bears a third of its load
    of_unit_pressure = node_vectors(mesh.points + at.u, mesh.boundary) / 3.0
    forces = (of_unit_pressure[:, :, None] * weights[:, None]).reshape(of_unit_pressure.size, -1)
    return _visible_modes(at.answers_of_columns(forces), at.sensors.is_displacement)


def _free_of_surface(at: Linearisation) -> Bools:
    """Nodes (N,) on the surface that are not held."""
    model = at.system.model
    on_surface = nodes_of(model.mesh.boundary, len(model.mesh.points))
    return np.asarray(on_surface & ~model.constrained.reshape(-1, 3).all(axis=1))


def eigenstresses(at: Linearisation, length: float) -> Floats:
    """Columns (n, k) of an eigenstress of a length [m], all six components."""
    mesh = at.system.model.mesh
    sites = mesh.centres[spread_points(mesh.centres, length, 700)]
    columns = stress_patches(at, mesh.points + at.u, sites, length)
    return _visible_modes(columns, at.sensors.is_displacement)


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
    ends, modes = finite_times(np.array(times)), modes_of(len(times))

    def about(moment: Moment) -> Floats:
        state = moment.at
        courses = modes_between(ends, modes, finite_times(np.concatenate([times, moment.times]))[len(times) :])
        [bulk] = Effects(state).of([volume])
        columns = np.column_stack([state.answers_of_elements(state.element_forces, tissues), bulk.columns / volume.sd])
        return with_courses(columns, courses)

    columns = _visible_modes(at.summed_in_time(about), at.sensors.is_displacement)
    # nothing that is known loads the body
    if not columns.any():
        return nothing
    not_linear = with_courses(smooth, modes_of_rows(times, at.sensors))
    return np.column_stack([columns, belief("unknown.not_linear") * not_linear])


def stress_beside_held(at: Linearisation, length: float) -> Floats:
    """Columns (n, k) of patches of an eigenstress of a length [m] which what is held is a part of.

    What they exert on nodes that can move has a net force: held nodes carry its counterpart. Of 1 m root mean square.
    """
    from scipy.spatial import cKDTree

    model = at.system.model
    held = model.mesh.points[model.constrained[: len(model.mesh.points)].all(axis=1)]
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


def fields(at: Linearisation, lengths: Sequence[float], forces: Sequence[Floats]) -> dict[str, Floats]:
    """Columns of every field by its name. `lengths` [m]. `forces` (n, k): `body_forces` of these lengths."""
    made: dict[str, Callable[[], Floats]] = {}
    for length, columns in zip(lengths, forces, strict=True):
        # in bodies of any size
        size = f"{number(1e3 * length)} mm"
        made[f"body force, {size}"] = partial(np.asarray, columns)
        made[f"eigenstress, {size}"] = partial(eigenstresses, at, length)
        if _free_of_surface(at).any():
            made[f"traction, {size}"] = partial(tractions, at, length)
            made[f"pressure, {size}"] = partial(pressures, at, length)
    columns_by_name = zip(made, in_threads(lambda each: each(), list(made.values())), strict=True)
    return {name: columns for name, columns in columns_by_name if columns.shape[1]}


def _visible_modes(columns: Floats, rows: Bools) -> Floats:
    """The modes (n, k) of columns that displacements, in some of the rows (n,), see."""
    # modes of displacements alone: recorded forces have another unit, and would dominate
    rows = rows if rows.any() else np.ones(len(rows), dtype=bool)
    squares, vectors = np.linalg.eigh(columns[rows] @ columns[rows].T)
    sizes, vectors = np.sqrt(np.maximum(squares[::-1], 0.0)), vectors[:, ::-1]
    total = np.cumsum(sizes**2) / max(float(np.sum(sizes**2)), 1e-300)
    kept = min(int(np.searchsorted(total, 1.0 - belief("unknown.cut"))) + 1, int(belief("unknown.modes")))
    modes = columns @ (columns[rows].T @ (vectors[:, :kept] / np.maximum(sizes[:kept], 1e-300)))
    return np.asarray(modes / max(root_mean_square(modes[rows]), 1e-300))
