"""How large a body is, and along which axes, however it lies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def extent(points: NDArray[np.floating[Any]]) -> float:
    """Twice the distance of the farthest of points (n, 3) from their mean, in their unit.

    Of a block it is the diagonal. A bounding box along the axes is up to 1.7 times as large for a body that was turned.
    """
    return 2.0 * float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())


def principal_axes(points: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Unit vectors, rows of (3, 3), along which points (n, 3) spread the least, more and the most.

    They turn with a body; of one that spreads alike along several axes these are any.
    """
    apart = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(apart.T @ apart)[1].T, dtype=np.float64)
