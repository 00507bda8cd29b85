"""A sparse matrix collected column by column, such as the forces of thousands of patches on one mesh."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.arrays import Floats, Ints


class SparseColumns:
    """Collects columns of one length; those that are zero are left out.

    `size`: rows. `numbers`: under which those that are not zero were added.
    """

    def __init__(self, size: int) -> None:
        self.numbers: list[int] = []
        self._size = size
        self._rows: list[Ints] = []
        self._values: list[Floats] = []

    def add(self, number: int, column: Floats) -> None:
        """Add a column (size,)."""
        # `flatnonzero` of booleans is eight times as fast as of numbers
        rows = np.flatnonzero(column != 0.0)
        if len(rows):
            self.numbers.append(number)
            self._rows.append(rows)
            self._values.append(column[rows])

    def matrix(self) -> Any:
        """Those that are not zero: SciPy CSC (size, k), in the order of `numbers`."""
        from scipy.sparse import csc_matrix

        first = np.cumsum([0, *(len(rows) for rows in self._rows)])
        shape = self._size, len(self.numbers)
        return csc_matrix((np.concatenate(self._values), np.concatenate(self._rows), first), shape)
