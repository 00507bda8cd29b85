"""Nuisances of declared boundaries: where what is held ends, and how the nodes of a set share a force.

A node set says where a boundary ends to half an element at best. What is held may end anywhere along the edges from
its last nodes to the next ones that are free: each of the former may be released in part, each of the latter held in
part. Where the body itself has an edge there, as a cylinder between plates has, the border is known.

The nodes of a set share a force evenly by definition. A body has no nodes: of a force that is spread over an area each
has a part in proportion to the area around it, which is known of this mesh, and whatever else another mesh of the same
body would give it.
"""

from typing import Any, NamedTuple

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.inference.beliefs import belief
from warpbrain.mesh import TetMesh
from warpbrain.mesh.surface import face_vectors, node_areas, node_vectors
from warpbrain.physics.load import NodalForce
from warpbrain.worlds.body.linearisation import Linearisation, Moment, gathered


class Border(NamedTuple):
    """The line on the surface of a body where what is held ends, but for where that is an edge of the body."""

    held: Ints  # nodes on it
    free: Ints  # (b,), nodes of the triangles that it runs through
    mean_of_held: Any  # SciPy CSR (b, N): of the held nodes of the triangles of each


def border_of(mesh: TetMesh, constrained: Bools) -> Border:
    """The border of the held nodes of a mesh, all of whose components (N, 3) are constrained; of free ones none is."""
    from scipy.sparse import csr_matrix

    held: Bools = np.all(constrained, axis=1)
    movable: Bools = ~np.any(constrained, axis=1)
    faces, members = mesh.boundary, held[mesh.boundary]
    inside: Bools = np.all(members, axis=1)
    areas, normals = face_vectors(mesh.points, faces), node_vectors(mesh.points, faces[inside])
    sizes = np.linalg.norm(areas, axis=1)[:, None] * np.linalg.norm(normals[faces], axis=2)
    # a node that is held without a triangle around it has no normal, and what is held ends there
    flat = np.einsum("ki,kci->kc", areas, normals[faces]) >= np.cos(belief("mesh.body_edge")) * sizes
    at_border = members & flat & ~inside[:, None]
    triangle, corner = np.nonzero(movable[faces] & at_border.any(axis=1)[:, None])
    free, number = np.unique(faces[triangle, corner], return_inverse=True)
    weights = at_border[triangle] / np.bincount(number, at_border[triangle].sum(axis=1))[number, None]
    rows, columns = np.repeat(number, 3), faces[triangle].ravel()
    mean_of_held = csr_matrix((weights.ravel(), (rows, columns)), (len(free), len(held)))
    return Border(np.unique(faces[at_border]).astype(np.int64), free.astype(np.int64), mean_of_held)


def boundary_columns(at: Linearisation) -> Floats:
    """Change (n, k) of what is recorded [m], [N] by one standard deviation of each node's part in a boundary.

    Held nodes of the border, free ones, and nodes that share a force; k = 0 if there are none.
    """
    border = border_of(at.system.model.mesh, at.system.model.constrained)

    def edges(moment: Moment) -> Floats:
        return np.hstack([_released(moment.at, border.held), _restrained(moment.at, border)])

    return np.hstack([belief("mesh.held_edge") * at.summed(edges, "stiffness"), at.summed(_force_shares, "loads")])


def visible_modes(columns: Floats) -> Floats:
    """Orthonormal combinations (b, k) of columns (n, b) that have all of their variance but the part `unknown.cut`."""
    _, sizes, modes = np.linalg.svd(columns, full_matrices=False)
    left = np.cumsum(sizes[::-1] ** 2)[::-1]
    return np.asarray(modes[left > belief("unknown.cut") * left[:1].sum()].T)


def _released(at: Linearisation, nodes: Ints) -> Floats:
    """Response (n, k) where each of some held nodes (k,) is released, and the others are not."""
    components, sensors, free = _components(nodes), at.sensors, at.free
    coupling = at.stiffness[free][:, components].tocsc()
    condensed = at.stiffness[components][:, components].toarray() - at.factors.solve(coupling, left=coupling.T)
    moved = _nodal_vectors(nodes, -_block_solutions(condensed, at.reactions[nodes]), len(at.u))
    forces = at.stiffness @ moved
    direct = sensors.by_displacement @ moved + sensors.by_reactions @ forces
    forces = -forces.multiply(free[:, None]).tocsc()
    return np.asarray(direct.toarray() + at.answers_of_columns(forces))


def _restrained(at: Linearisation, border: Border) -> Floats:
    """Response (n, b) where each of the free nodes at a border moves as the held ones there do on average."""
    from scipy.sparse import eye

    nodes, number = border.free, np.cumsum(at.free) - 1
    unit = eye(number[-1] + 1, format="csc")[:, number[_components(nodes)]]
    compliance = at.factors.solve(unit, left=unit.T)
    forces = -_block_solutions(compliance, at.u[nodes] - border.mean_of_held @ at.u)
    return at.answers_of_columns(_nodal_vectors(nodes, forces, len(at.u)))


def _components(nodes: Ints) -> Ints:
    """Numbers (3 k,) of the components of nodes (k,)."""
    return np.asarray((3 * nodes[:, None] + np.arange(3)).ravel())


def _block_solutions(matrix: Floats, right: Floats) -> Floats:
    """Solution (k, 3) of each block on the diagonal of a matrix (3 k, 3 k) for the right-hand sides (k, 3)."""
    count, each = len(right), np.arange(len(right))
    blocks = matrix.reshape(count, 3, count, 3)[each, :, each]
    return np.asarray(np.linalg.solve(blocks, right[:, :, None])[:, :, 0])


def _nodal_vectors(nodes: Ints, values: Floats, count: int) -> Any:
    """A column for the vector (k, 3) at each of some nodes (k,) of a body with `count` nodes, SciPy CSC (3 N, k)."""
    columns = np.arange(len(nodes))
    return gathered(nodes[:, None], values[:, None], columns, (count, len(nodes))).tocsc()


def _force_shares(moment: Moment) -> Floats:
    """Response (n, k) where nodes share the force of their set by the area around each, and where each has more of it.

    What one has more all of them have less.
    """
    at, model = moment.at, moment.at.system.model
    answers = [np.zeros((len(at.sensors), 0))]
    for load in model.loads:
        if isinstance(load, NodalForce):
            nodes = np.flatnonzero(model.mesh.node_sets[load.nodes])
            each = load.factor(moment.time) * np.asarray(load.total) / len(nodes)
            answer = at.answers_of_columns(_nodal_vectors(nodes, np.tile(each, (len(nodes), 1)), len(at.u)))
            answer -= answer.mean(axis=1, keepdims=True)
            areas = node_areas(model.mesh.points, model.mesh.boundary)[nodes]
            by_area = answer @ (areas / areas.mean() - 1.0) if areas.any() else np.zeros(len(answer))
            answers += [belief("loads.by_area") * by_area[:, None], belief("loads.share") * answer]
    return np.hstack(answers)
