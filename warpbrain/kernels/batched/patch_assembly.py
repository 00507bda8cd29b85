"""Matrices of many samples from their elements, in a launch for each law and one that adds up what patches share."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats
from warpbrain.kernels.batched.cluster import on_device
from warpbrain.kernels.batched.parts import Ints
from warpbrain.kernels.batched.patch_kernels import (
    BITS,
    THREADS,
    WIDTH,
    Tables,
    block_bytes,
    fits,
    patch_kernel,
    sum_kernel,
)
from warpbrain.kernels.batched.patches import Patches, patches_of
from warpbrain.kernels.module import Precision
from warpbrain.kernels.tetrahedron import DeviceLaw


class PatchAssembly:
    """Matrices `k K + m M` of lists of slots, with the rows and columns of constrained components replaced by those of
    the identity, from the displacements.

    `groups`, as those of `batched.elements`: a law, elements (of NumPy) that share it, the tissue of each, and a row of
    parameters, of float64, for each tissue and slot, slots fastest. Nodes of an element of the mesh ascend. `pairs`
    (p, 2), `free` (n, 3), `mass` (n,), `u` (n, 3, slots) of float64, `values` (p, 9, slots), of which the numbers of a
    slot are side by side in memory. `shared_bytes`: what a block may have of a multiprocessor's shared memory.
    """

    def __init__(
        self,
        groups: Sequence[tuple[DeviceLaw, NDArray[np.intp], NDArray[np.intp], wp.array]],
        points: Floats,
        tetrahedra: Ints,
        shape_gradients: Floats,
        volumes: Floats,
        pairs: Ints,
        free: Bools,
        mass: wp.array,
        u: wp.array,
        values: wp.array,
        precision: Precision,
        shared_bytes: int,
    ) -> None:
        self._device, self._slots, self._values = u.device, u.shape[2], values
        there_is_room = partial(fits, real=precision.numpy.itemsize, room=block_bytes(shared_bytes))
        members = [elements for _, elements, _, _ in groups]
        patches, sums = patches_of(points, tetrahedra, pairs, free, members, WIDTH, THREADS // WIDTH, there_is_room)
        # no launch takes an array without rows
        extras = wp.zeros((self._slots, max(1, sums.extras), 9), dtype=precision.scalar, device=self._device)
        self._extras = extras.transpose((1, 2, 0))
        self._sum = sum_kernel(precision)
        self._sums = [wp.array(table, dtype=int, device=self._device) for table in (sums.pairs, sums.extra_starts)]
        geometry = np.column_stack([shape_gradients.reshape(-1, 9), volumes])
        self._launches = []
        for (law, elements, tissue, parameters), of in zip(groups, patches, strict=True):
            made, kernel = patch_kernel(law, precision, shared_bytes)
            tissues = np.zeros(len(tetrahedra), dtype=np.int32)
            tissues[elements] = tissue
            starts, places, shapes = self._batches(of, tissues, geometry)
            tables = {**vars(of), "batch_starts": starts, "places": places, "rows": of.rows << BITS | of.kept}
            patched = made()
            patched.tables = on_device(Tables, tables, self._device)
            patched.geometry = wp.array(shapes, dtype=wp.float64, device=self._device)
            patched.parameters, patched.u, patched.mass = parameters, u, mass
            patched.values, patched.extras = values, self._extras
            self._launches.append((kernel, len(of.edge_counts), patched))

    def _batches(self, of: Patches, tissues: Ints, geometry: Floats) -> tuple[Any, Any, Any]:
        """Where those of each patch begin in batches of as many elements as a block has threads; two corners or edges
        in each number, and the tissue; and geometry, as threads beside each other read them."""
        batches = of.round_counts * WIDTH // THREADS
        used = [(patch, batch) for patch, count in enumerate(batches) for batch in range(count)]

        def by_thread(values: Any) -> Any:
            """Numbers (patches, rounds, width, n) as (batches, n, threads)."""
            shaped = values.reshape(len(batches), -1, THREADS, values.shape[-1]).transpose(0, 1, 3, 2)
            return np.ascontiguousarray([shaped[place] for place in used])

        pairs = np.concatenate([of.corners, of.edges], axis=-1)
        places = np.concatenate([pairs[..., ::2] | pairs[..., 1::2] << 16, tissues[of.elements][..., None]], axis=-1)
        # where there is no element, one without a volume
        shapes = np.where(of.elements[..., None] < 0, 0.0, geometry[of.elements])
        return np.r_[0, np.cumsum(batches)], by_thread(places), by_thread(shapes)

    def assemble(self, slots: wp.array, count: wp.array, k: wp.array, m: wp.array) -> None:
        """Make the matrices of a list of slots, with `k` and `m` of each slot."""
        for kernel, patches, patched in self._launches:
            wp.launch(
                kernel, dim=(self._slots, patches, THREADS), inputs=[slots, count, k, m, patched],
                device=self._device, block_dim=THREADS,
            )  # fmt: skip
        if len(self._sums[0]):
            wp.launch(
                self._sum, dim=(self._slots, len(self._sums[0]), 9),
                inputs=[slots, count, *self._sums, self._extras, self._values], device=self._device, block_dim=128,
            )  # fmt: skip
