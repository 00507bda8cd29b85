"""Where the entries of a matrix of tetrahedra go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, csr_matrix

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pattern:
    """Blocks of a sparse matrix, and what adds up those of each pair of nodes of a tetrahedron."""

    columns: NDArray[np.int64]
    starts: NDArray[np.int64]
    adding: csr_matrix
    diagonal: NDArray[np.int64]

    @classmethod
    def of(cls, cells: NDArray[np.int64], n: int) -> Pattern:
        """The pattern of tetrahedra (m, a) of n nodes."""
        rows, columns = np.broadcast_arrays(cells[:, :, None], cells[:, None, :])
        keys, place = np.unique(rows.ravel() * n + columns.ravel(), return_inverse=True)
        starts = np.searchsorted(keys, np.arange(n + 1) * n)
        diagonal = np.searchsorted(keys, np.arange(n) * (n + 1))
        count = len(place)
        adding = csr_matrix((np.ones(count), (place, np.arange(count))), shape=(len(keys), count))
        return cls(keys % n, starts, adding, diagonal)

    def matrix(self, local: Floats, springs: Floats | None) -> bsr_matrix:
        """Assemble local matrices (m, a, b, 3, 3)."""
        data = (self.adding @ local.reshape(-1, 9)).reshape(-1, 3, 3)
        if springs is not None:
            data[self.diagonal] += springs
        n = len(self.starts) - 1
        return bsr_matrix((data, self.columns, self.starts), shape=(3 * n, 3 * n))
