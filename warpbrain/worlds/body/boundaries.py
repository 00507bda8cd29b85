"""Nuisances of declared boundaries: where what is held ends, and how the nodes of a set share a force.

A node set says where a boundary ends to half an element at best. What is held may end anywhere along the edges from
its last nodes to the next ones that are free: each of the former may be let go in part, and each of the latter be held
in part. Where the body itself has an edge there, as a cylinder between plates has, the border is known.

The nodes of a set share a force evenly by definition. A body has no nodes: of a force that is spread over an area each
has a part in proportion to the area around it, which is half as large again or half as large.
"""

from typing import Any, NamedTuple

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.inference.beliefs import belief
from warpbrain.mesh import TetMesh
from warpbrain.mesh.surface import face_vectors
from warpbrain.physics.load import NodalForce
from warpbrain.worlds.body.linearisation import Linearisation, Moment


class Border(NamedTuple):
    """The line on the surface of a body where what is held ends, but for where that is an edge of the body."""

    ends: Ints  # held nodes on it
    beside: Ints  # (b,), free nodes of the triangles that it runs through
    means: Any  # SciPy CSR (b, N): takes the mean of the held nodes of these triangles


def border_of(mesh: TetMesh, held: Bools) -> Border:
    """Of nodes (N,) of a mesh that are held."""
    from scipy.sparse import csr_matrix

    faces, members = mesh.boundary, held[mesh.boundary]
    areas = face_vectors(mesh.points, faces)
    inside: Bools = np.all(members, axis=1)
    normals = np.zeros((len(held), 3))
    for corner in range(3):
        np.add.at(normals, faces[inside, corner], areas[inside])
    sizes = np.linalg.norm(areas, axis=1)[:, None] * np.linalg.norm(normals[faces], axis=2)
    # a node that is held without a triangle around it has no normal, and what is held ends there
    flat = np.einsum("ki,kci->kc", areas, normals[faces]) >= np.cos(belief("mesh.body_edge")) * sizes
    ends = members & flat & ~inside[:, None]
    across = ends.any(axis=1)
    triangle, free = np.nonzero(~members & across[:, None])
    beside, number = np.unique(faces[triangle, free], return_inverse=True)
    weights = ends[triangle] / np.bincount(number, ends[triangle].sum(axis=1))[number, None]
    rows, columns = np.repeat(number, 3), faces[triangle].ravel()
    means = csr_matrix((weights.ravel(), (rows, columns)), (len(beside), len(held)))
    return Border(np.unique(faces[ends]).astype(np.int64), beside.astype(np.int64), means)


def boundary_columns(at: Linearisation) -> Floats:
    """One standard deviation of each: (n, k), k = 0 where nothing is held and no force shared by nodes."""
    model = at.system.model
    held: Bools = np.all(model.constrained, axis=1)
    border = border_of(model.mesh, held)

    def edges(moment: Moment) -> Floats:
        return np.hstack([_let_go(moment.at, border.ends), _held(moment.at, border)])

    return np.hstack([belief("mesh.held_edge") * at.summed(edges, "stiffness"), at.summed(_shares, "loads")])


def visible_modes(columns: Floats) -> Floats:
    """Combinations (b, k) of columns (n, b) that hold all of their variance but for `unknown.cut`."""
    _, sizes, modes = np.linalg.svd(columns, full_matrices=False)
    left = np.cumsum(sizes[::-1] ** 2)[::-1]
    return np.asarray(modes[left > belief("unknown.cut") * left[:1].sum()].T)


def _let_go(at: Linearisation, nodes: Ints) -> Floats:
    """Response (n, k) where each of some held nodes (k,) is let go, and the others are not."""
    components, sensors, free = _components(nodes), at.sensors, at.free
    coupling = at.stiffness[free][:, components].tocsc()
    condensed = at.stiffness[components][:, components].toarray() - at.factors.solve(coupling, left=coupling.T)
    moved = _each(nodes, -_solved(condensed, at.reactions[nodes]), len(at.u))
    forces = at.stiffness @ moved
    direct = sensors.by_displacement @ moved + sensors.by_reactions @ forces
    forces = -forces.multiply(free[:, None]).tocsc()
    return np.asarray(direct.toarray() + at.answers_of_columns(forces))


def _held(at: Linearisation, border: Border) -> Floats:
    """Response (n, b) where each of the free nodes beside a border moves as what is held there."""
    from scipy.sparse import csc_matrix

    nodes, number = border.beside, np.cumsum(at.free) - 1
    rows, count = number[_components(nodes)], 3 * len(nodes)
    unit = csc_matrix((np.ones(count), (rows, np.arange(count))), (int(at.free.sum()), count))
    compliance = at.factors.solve(unit, left=unit.T)
    forces = -_solved(compliance, at.u[nodes] - border.means @ at.u)
    return at.answers_of_columns(_each(nodes, forces, len(at.u)))


def _components(nodes: Ints) -> Ints:
    return np.asarray((3 * nodes[:, None] + np.arange(3)).ravel())


def _solved(matrix: Floats, right: Floats) -> Floats:
    """Solution (k, 3) of each block on the diagonal of a matrix (3 k, 3 k) for the right-hand sides (k, 3)."""
    count, each = len(right), np.arange(len(right))
    blocks = matrix.reshape(count, 3, count, 3)[each, :, each]
    return np.asarray(np.linalg.solve(blocks, right[:, :, None])[:, :, 0])


def _each(nodes: Ints, values: Floats, count: int) -> Any:
    """Vectors (k, 3) of nodes (k,) as a column each, SciPy CSC (3 count, k)."""
    from scipy.sparse import csc_matrix

    columns = np.repeat(np.arange(len(nodes)), 3)
    return csc_matrix((values.ravel(), (_components(nodes), columns)), (3 * count, len(nodes)))


def _shares(moment: Moment) -> Floats:
    """Response (n, k) where each node takes more of the force of its set, and all of them as much less."""
    at, model = moment.at, moment.at.system.model
    answers = [np.zeros((len(at.sensors), 0))]
    for load in model.loads:
        if isinstance(load, NodalForce):
            nodes = np.flatnonzero(model.mesh.node_sets[load.nodes])
            each = belief("loads.share") * load.factor(moment.time) * np.asarray(load.total) / len(nodes)
            answer = at.answers_of_columns(_each(nodes, np.tile(each, (len(nodes), 1)), len(at.u)))
            answers.append(answer - answer.mean(axis=1, keepdims=True))
    return np.hstack(answers)
