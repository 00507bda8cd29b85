"""Background mesh: the body-centred cubic lattice, and cuts of it along the zero level of a field."""

from collections.abc import Callable

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.cases.building.mmg import Cells
from warpbrain.mesh.surface import EDGES

#: From positions (k, 3) to values (k,).
Field = Callable[[Floats], Floats]


def bcc_lattice(lower: Floats, upper: Floats, spacing: float) -> tuple[Floats, Ints]:
    """Points (n, 3), corners of cubes and then their centres, and tetrahedra (m, 4) that fill a box with the corners
    (3,) and (3,). All are alike, positively oriented, with angles of 60 and 90 degrees: each has an edge between two
    neighbouring centres and the opposite edge on the face between them."""
    cells = np.maximum(np.ceil((upper - lower) / spacing).astype(int), 1)
    corners = cells + 1
    index, middle = (np.ascontiguousarray(np.indices(shape).reshape(3, -1).T) for shape in (corners, cells))
    points = np.concatenate([lower + spacing * index, lower + spacing * (middle + 0.5)])
    corner = np.arange(len(index)).reshape(corners)
    centre = len(index) + np.arange(len(middle)).reshape(cells)
    tetrahedra = []
    for axis in range(3):
        step, side, up = np.roll(np.eye(3, dtype=np.int64), -axis, axis=0)
        first = middle[middle[:, axis] < cells[axis] - 1]
        square = [corner[tuple((first + step + offset).T)] for offset in (0 * step, side, side + up, up)]
        a, b = centre[tuple(first.T)], centre[tuple((first + step).T)]
        tetrahedra += [np.stack([a, b, square[k], square[(k + 1) % 4]], axis=1) for k in range(4)]
    return points, np.concatenate(tetrahedra)


# a node closer to the surface than this share of an edge is taken to lie on it: no needle is cut off there
SNAP = 0.06


def cut(cells: Cells, field: Field) -> tuple[Cells, Bools]:
    """Split every edge at which a field crosses its zero level, there; pieces have the labels of what they are of.

    Returns the cut mesh, conforming and positively oriented if the given one is, and for each tetrahedron whether the
    field is positive there.

    Bisecting an edge splits every tetrahedron around it in two, which keeps the mesh conforming whatever the order.
    Here the crossed edges are bisected in order of their number. One tetrahedron has at most four of them and each
    piece inherits those that are left, so four rounds over all tetrahedra at once do all of it.
    """
    points, tetrahedra, labels = cells.points, cells.tetrahedra, cells.labels
    value = field(points)
    edges = np.unique(np.sort(tetrahedra[:, EDGES].reshape(-1, 2), axis=1), axis=0)
    crossed = edges[value[edges[:, 0]] * value[edges[:, 1]] < 0]
    share = _roots(points, crossed, value, field)
    value[crossed[share < SNAP, 0]] = 0.0
    value[crossed[share > 1 - SNAP, 1]] = 0.0
    still = value[crossed[:, 0]] * value[crossed[:, 1]] < 0
    crossed, share = crossed[still], share[still, None]
    key = crossed[:, 0] * len(points) + crossed[:, 1]
    fresh = points[crossed[:, 0]] * (1 - share) + points[crossed[:, 1]] * share
    count = len(points)
    for _ in range(4):
        tetrahedra, labels = _bisect_first(tetrahedra, labels, key, count)
    value = np.append(value, np.zeros(len(fresh)))
    points = np.concatenate([points, fresh])
    total = value[tetrahedra].sum(axis=1)
    # all four nodes on the surface: decided by what the field says in the middle
    flat = total == 0
    total[flat] = field(points[tetrahedra[flat]].mean(axis=1))
    return Cells(points, tetrahedra, labels), total > 0


def _roots(points: Floats, edges: Ints, value: Floats, field: Field) -> Floats:
    """Where along each edge the field vanishes, 0 to 1, by bisection: safe where the field levels off."""
    start, end = points[edges[:, 0]], points[edges[:, 1]]
    positive = value[edges[:, 0]] > 0
    low, high = np.zeros(len(edges)), np.ones(len(edges))
    for _ in range(12):
        middle = (low + high) / 2
        same = (field(start + middle[:, None] * (end - start)) > 0) == positive
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return (low + high) / 2


def _bisect_first(tetrahedra: Ints, labels: Ints, key: Ints, count: int) -> tuple[Ints, Ints]:
    """Bisect, in every tetrahedron that has one, the crossed edge of the lowest number."""
    pairs = np.sort(tetrahedra[:, EDGES], axis=2)
    old = (pairs < count).all(axis=2)
    wanted = np.where(old, pairs[..., 0] * count + pairs[..., 1], -1)
    at = np.minimum(np.searchsorted(key, wanted), max(len(key) - 1, 0))
    crossed = old & (key[at] == wanted) if len(key) else np.zeros_like(old)
    number = np.where(crossed, at, len(key))
    local = number.argmin(axis=1)
    split = np.flatnonzero(crossed.any(axis=1))
    new = count + number[split, local[split]]
    halves = [tetrahedra[split].copy() for _ in range(2)]
    for end, half in enumerate(halves):
        half[np.arange(len(split)), EDGES[local[split], end]] = new
    keep = np.ones(len(tetrahedra), dtype=bool)
    keep[split] = False
    return np.concatenate([tetrahedra[keep], *halves]), np.concatenate([labels[keep], labels[split], labels[split]])
