"""What whitened rows tell of causes where some points are known to be mistaken: all but these rows, and a little more.

In units of all that is not known, rows of density `N(0, I)`, those of mistaken points become known to nobody if what is
left is taken perpendicular to their columns `E`. Of where such a point is tells `(E^T E)^-1 E^T`, to a covariance of
`(E^T E)^-1`: so far from there is what the mistake was.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from referee import mistakes
from referee.library import Draws

Floats = NDArray[np.float64]

#: Step and end of the table of the density of mistakes by their length [m].
_STEP, _FARTHEST = 5e-5, 0.03


class Lost:
    """Whitened rows with some mistaken points.

    Parameters
    ----------
    columns : (rows, 3 z) array
        What a metre along each axis of each of these points is in units of all that is not known.
    """

    def __init__(self, columns: Floats) -> None:
        self._basis, triangle = np.linalg.qr(columns)
        self._expect = np.linalg.solve(triangle, self._basis.T)
        covariance = self._expect @ self._expect.T
        self._count = count = columns.shape[1] // 3
        blocks = np.einsum("iaib->iab", covariance.reshape(count, 3, count, 3))
        lengths = np.arange(0.0, _FARTHEST, _STEP)
        along = np.stack([lengths, 0.0 * lengths, 0.0 * lengths], axis=1)
        tables = [mistakes.log_density(along, np.repeat(block[None], len(along), axis=0)) for block in blocks]
        self._lengths, self._tables = lengths, tables

    def left(self, rows: Floats) -> Floats:
        """Rows (k, rows) without what is lost."""
        return np.asarray(rows - (rows @ self._basis) @ self._basis.T)

    def at(self, rows: Floats) -> Floats:
        """Where rows (k, rows) let expect the mistaken points, (k, z, 3) [m]."""
        return np.asarray((rows @ self._expect.T).reshape(len(rows), self._count, 3))

    def log_density(self, wrong: Floats) -> Floats:
        """Log density (...) of mistakes (..., z, 3) [m]."""
        total = np.zeros(wrong.shape[:-2])
        for k, table in enumerate(self._tables):
            far = np.linalg.norm(wrong[..., k, :], axis=-1)
            # beyond the table it falls on as it does at its end
            slope = (table[-1] - table[-2]) / _STEP
            total += np.interp(far, self._lengths, table) + slope * np.maximum(far - self._lengths[-1], 0.0)
        return total

    def of(self, draws: Draws) -> tuple[Draws, Floats]:
        """Draws of what is left, and how far each moves the mistaken points (k, z, 3) [m] at a size of 1."""
        left = self.left(draws.directions)
        lengths = np.maximum(np.linalg.norm(left, axis=1), 1e-9)
        seen = Draws(left / lengths[:, None], draws.low * lengths, draws.high * lengths, draws.both)
        return seen, self.at(draws.directions) / lengths[:, None, None]
