"""Errors of recorded rows that a mesh of this resolution cannot show: the change of each row over one element.

The standard deviation of a row's error is a part of that change, `mesh.unresolved` of `priors.toml`. Elements of half
the size with the same wall do not reduce it, so it is no part of the discretisation error.
"""

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.mesh.surface import SIDES, feature_normals
from warpbrain.recordings.closest import ClosestPoints

#: Rounds of weighted least squares that come to least absolute deviations, and the least of these, relative to the
#: displacement: smaller ones are alike.
_ROUNDS, _LEAST = 6, 1e-3


def change_over_element(points: Floats, displacement: Floats, edges: Floats) -> Floats:
    """Change of recorded displacement over an edge of the element in which each point is.

    A wall that was cut out of elements is a staircase, and a linear element has one gradient. Where displacement
    changes much from place to place the mesh has a recorded point beside where it is, by a part of the edge of its
    element, and its displacement is wrong by that part of this change (errors in variables, by effective variances:
    Orear, Am. J. Phys. 50 (1982) 912). A finer mesh with the same wall does not show this error; taken for noise alone
    it would look like a second force beside the first. It is that of what was recorded, whatever is thought to act.

    Gradients over each point and its neighbours are by least absolute deviations: a gross error is no gradient of its
    neighbours, and what changes faster than tissue can is not tissue. Points and displacement (n, 3) were recorded at
    one time [m]; `edges` (n,) are mean lengths of those of the element [m]. Returns (n, 3, 3), of each component along
    each axis [m]; zero of points that are too few to tell.
    """
    from scipy.spatial import cKDTree

    neighbours = min(round(belief("mesh.neighbours")), len(points) - 1)
    if neighbours < 3:
        return np.zeros((len(points), 3, 3))
    near = cKDTree(points).query(points, neighbours + 1)[1]
    weights = np.ones((*near.shape, 1))
    least = _LEAST * float(np.median(np.linalg.norm(displacement, axis=1)))
    for _ in range(_ROUNDS):
        share = weights / weights.sum(axis=1, keepdims=True)
        offsets = points[near] - np.sum(share * points[near], axis=1, keepdims=True)
        changes = displacement[near] - np.sum(share * displacement[near], axis=1, keepdims=True)
        # of points in one plane the gradient across it is not known, and taken for zero
        root = np.sqrt(weights)
        gradients = np.linalg.pinv(root * offsets, rcond=belief("mesh.flat")) @ (root * changes)
        left = np.linalg.norm(changes - offsets @ gradients, axis=2, keepdims=True)
        weights = 1.0 / np.maximum(left, least + np.finfo(float).tiny)
    steepest = belief("mesh.steepest")
    sizes = np.linalg.norm(gradients, ord=2, axis=(1, 2), keepdims=True)
    gradients *= np.minimum(1.0, steepest / np.maximum(sizes, steepest))
    return np.asarray(edges[:, None, None] * gradients.transpose(0, 2, 1))


def turn_over_element(points: Floats, faces: NDArray[np.integer], at: ClosestPoints) -> Floats:
    """Change of a surface's distance from its flat faces over an edge: edge length times tilt of the corners' normals.

    Between its corners a flat face is not on the smooth surface that was meshed. Of a sphere of radius `R` and
    equilateral faces of edge `h` the corners' normals are tilted by `h / (sqrt(3) R)` from that of the face, and the
    mean gap is `h^2 / (8 R)`: sqrt(3) / 8 = 0.22 of what is returned.

    `points` (n, 3): of the nodes [m]. `faces` (k, 3): node ids, oriented outwards. `at`: m points of the surface.
    Returns (m, 3): root mean square over the corners, by their weights at each point, of each component of the normal
    there less those of the faces that meet there, times the mean edge of each face [m]; zero of a plane. It is the same
    on both sides of an edge.
    """
    normals = feature_normals(points, faces)[0]
    sides = points[faces[:, SIDES]]
    edges = np.linalg.norm(sides[:, :, 1] - sides[:, :, 0], axis=2).mean(axis=1)
    squares = np.zeros((len(points), 3))
    np.add.at(squares, faces, (edges[:, None, None] * (normals[:, 4:] - normals[:, :1])) ** 2)
    squares /= np.maximum(np.bincount(faces.ravel(), minlength=len(points)), 1)[:, None]
    return np.asarray(np.sqrt(np.einsum("mc,mck->mk", at.weights, squares[faces[at.face]])))
