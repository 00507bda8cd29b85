"""Memory of the host for results, written to before it is needed, while the device works.

The first time that a page of new memory is written to, the system looks for one and clears it: for the fields of some
hundred samples that takes as long as a step of all of them.
"""

import numpy as np

from warpbrain.arrays import Floats


class ResultRoom:
    """Room for fields (n, 3) of so many samples."""

    def __init__(self, nodes: int, samples: int) -> None:
        self._shape, self._samples = (nodes, 3), samples
        self._ready = self._empty(0)

    def _empty(self, count: int) -> Floats:
        return np.empty((count, *self._shape))

    def prepare(self) -> None:
        """Make room ready if there is none."""
        if not len(self._ready):
            self._ready = self._empty(self._samples)
            self._ready.fill(0.0)

    def take(self, count: int) -> Floats:
        """An array (count, n, 3) of any numbers, ready or not."""
        if count > len(self._ready):
            return self._empty(count)
        taken, self._ready = self._ready[:count], self._ready[count:]
        return taken
