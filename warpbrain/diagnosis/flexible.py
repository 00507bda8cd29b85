"""A force that nobody has a name for: any smooth body force, as columns over the sensors.

Gaussian patches all over the body, in three directions, independent of each other: a body force with a Gaussian process
of that length. Scaled to 1 m of mean displacement at the sensors, and cut to the modes that they see.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warpbrain.threads import in_threads
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.unknown import force_patches

Floats = NDArray[np.float64]

#: Lengths of patches in spacings of the sites, and scales in standard deviations of the noise.
LENGTHS, SCALES = (1.0, 2.4), (1.5, 4.0, 10.0)
#: Part of the variance that is cut off, and the most modes that are kept.
_CUT, _MOST = 1e-3, 150


def flexible_columns(at: Linearisation, lengths: Sequence[float]) -> tuple[Floats, ...]:
    """Columns (n, k) of a body force of each length [m], of 1 m root mean square over the displacements."""
    answers = [force_patches(at, length)[1] for length in lengths]
    return tuple(in_threads(lambda own: _seen(own.reshape(len(own), -1), at.sensors.is_displacement), answers))


def _seen(columns: Floats, rows: NDArray[np.bool_]) -> Floats:
    """The modes (n, k) of columns that displacements, in some of the rows (n,), see."""
    # modes of displacements: forces that were recorded have another unit, and would be all that counts
    lengths = columns[rows] if rows.any() else columns
    squares, left = np.linalg.eigh(lengths @ lengths.T)
    sizes, left = np.sqrt(np.maximum(squares[::-1], 0.0)), left[:, ::-1]
    total = np.cumsum(sizes**2) / np.sum(sizes**2)
    kept = min(int(np.searchsorted(total, 1.0 - _CUT)) + 1, _MOST)
    found = columns @ (lengths.T @ (left[:, :kept] / sizes[:kept]))
    rows = rows if rows.any() else np.ones(len(rows), dtype=bool)
    return np.asarray(found / np.sqrt(np.mean(np.sum(found[rows] ** 2, axis=1))))


def smooth_forces(flexible: Sequence[Floats], noise: float) -> list[Floats]:
    """Columns of smooth forces of each length, and of each size relative to a noise [m]."""
    return [scale * noise * columns for columns in flexible for scale in SCALES]
