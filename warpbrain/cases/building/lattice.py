"""Background mesh: the body-centred cubic lattice, all tetrahedra alike, with angles of 60 and 90 degrees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def bcc_lattice(
    lower: NDArray[np.float64], upper: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Tetrahedra that fill a box.

    Parameters
    ----------
    lower, upper : (3,) arrays
        Corners of the box.
    spacing : float
        Side of the cubes.

    Returns
    -------
    points : (n, 3) array
        Cube corners, then cube centres.
    tetrahedra : (m, 4) int64 array
        Positively oriented; each has an edge between two neighbouring centres and the opposite edge on the face
        between them.
    """
    cells = np.maximum(np.ceil((upper - lower) / spacing).astype(int), 1)
    corners = cells + 1
    index = np.stack(np.meshgrid(*(np.arange(n) for n in corners), indexing="ij"), axis=-1).reshape(-1, 3)
    middle = np.stack(np.meshgrid(*(np.arange(n) for n in cells), indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.concatenate([lower + spacing * index, lower + spacing * (middle + 0.5)])

    def corner(ijk: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.asarray(np.ravel_multi_index(tuple(ijk.T), tuple(corners)))

    def centre(ijk: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.asarray(len(index) + np.ravel_multi_index(tuple(ijk.T), tuple(cells)))

    tetrahedra = []
    for axis in range(3):
        step, side, up = np.roll(np.eye(3, dtype=np.int64), -axis, axis=0)
        first = middle[middle[:, axis] < cells[axis] - 1]
        square = [corner(first + step + offset) for offset in (0 * step, side, side + up, up)]
        a, b = centre(first), centre(first + step)
        tetrahedra += [np.stack([a, b, square[k], square[(k + 1) % 4]], axis=1) for k in range(4)]
    return points, np.concatenate(tetrahedra)
