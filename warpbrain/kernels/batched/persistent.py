"""Many systems of one pattern in one launch on a GPU: `warpbrain.kernels.persistent`, a group of blocks for a system.

A group is as large as it takes to keep a system on the chip, and there are as many groups as there is room for. Each
takes the next system of the list when it has ended one: element after element of the list by a fixed rule, so that
nothing depends on who was first. A system that is left off because few go on keeps its vectors, and goes on in the next
launch as if nothing had happened.
"""

from functools import cache
from typing import Any

import numpy as np
import warp as wp

from warpbrain.kernels.module import compiled_module
from warpbrain.kernels.persistent import MOST_BLOCKS, NUMBERS, THREADS, Meetings, native_code, share_rows, shared_memory
from warpbrain.kernels.precision import Precision

#: What a system that is left off keeps: scalars, and nine vectors of three components a row.
_SCALARS, _VECTORS = 8, 27


@cache
def persistent_batch_kernels(precision: Precision, shared_bytes: int, lanes: int, messages: int) -> tuple[Any, Any]:
    """Make (once) the kernel, and one that marks systems as not begun; see `persistent_kernel`."""
    scalar = precision.scalar
    module = compiled_module(f"persistent_{precision.name}_{shared_bytes}_{lanes}_{messages}_batched")
    module.options["block_dim"] = THREADS
    numbers = wp.constant(shared_bytes // 8)

    @wp.func_native(native_code(precision, shared_bytes, lanes, messages, batched=True))
    def solve(
        slots: wp.array[int],
        count: wp.array[int],
        linger: wp.array[int],
        remaining: wp.array[int],
        offsets: wp.array[int],
        columns: wp.array[int],
        pairs: wp.array[int],
        values: wp.array3d[scalar],
        diagonal: wp.array[int],
        starts: wp.array[int],
        b: wp.array3d[scalar],
        x: wp.array3d[scalar],
        tolerance: wp.float64,
        max_iterations: int,
        memory: wp.array2d[wp.float64],
        exchange: wp.array[wp.float64],
        messages: wp.array[wp.uint64],
        scratch: wp.array[wp.float64],
        control: wp.array[int],
        outcome: wp.array2d[wp.float64],
        solving: wp.array[int],
    ): ...

    @wp.kernel(module=module, launch_bounds=(THREADS, 1), grid_stride=False)
    def conjugate_gradients(
        slots: wp.array[int],
        count: wp.array[int],
        linger: wp.array[int],
        remaining: wp.array[int],
        offsets: wp.array[int],
        columns: wp.array[int],
        pairs: wp.array[int],
        values: wp.array3d[scalar],
        diagonal: wp.array[int],
        starts: wp.array[int],
        b: wp.array3d[scalar],
        x: wp.array3d[scalar],
        tolerance: wp.float64,
        max_iterations: int,
        memory: wp.array2d[wp.float64],
        exchange: wp.array[wp.float64],
        messages: wp.array[wp.uint64],
        scratch: wp.array[wp.float64],
        control: wp.array[int],
        outcome: wp.array2d[wp.float64],
        solving: wp.array[int],
    ):
        # all of the shared memory: the native code knows where it begins
        wp.tile_empty(shape=numbers, dtype=wp.float64, storage="shared")
        solve(
            slots, count, linger, remaining, offsets, columns, pairs, values, diagonal, starts, b, x, tolerance,
            max_iterations, memory, exchange, messages, scratch, control, outcome, solving,
        )  # fmt: skip

    @wp.kernel(module=module)
    def begin(slots: wp.array[int], count: wp.array[int], memory: wp.array2d[wp.float64], solving: wp.array[int]):
        lane = wp.tid()
        if lane >= count[0]:
            return
        memory[slots[lane], 0] = wp.float64(-1.0)
        solving[slots[lane]] = 1

    return conjugate_gradients, begin


def kept_bytes(rows: int) -> int:
    """Memory that a system of so many rows takes between launches."""
    return 8 * (_SCALARS + _VECTORS * rows + 4)


class PersistentBatch:
    """Solves systems of a list of slots; its parameters are those of `BatchedConjugateGradient`.

    Parameters
    ----------
    offsets, columns, blocks, diagonal, values : wp.array
    b, x : wp.array, shape (n, 3, slots)
    solving : wp.array of int, shape (slots,)
    precision : Precision
    tolerance : float
    max_iterations : int
    """

    def __init__(
        self,
        offsets: wp.array,
        columns: wp.array,
        blocks: wp.array,
        diagonal: wp.array,
        values: wp.array,
        b: wp.array,
        x: wp.array,
        solving: wp.array,
        precision: Precision,
        *,
        tolerance: float,
        max_iterations: int,
    ) -> None:
        self._device = device = x.device
        n, _, slots = x.shape
        rows = np.repeat(np.arange(n), np.diff(offsets.numpy()))
        # left of the diagonal it is the transpose of what is kept
        pairs = np.where(columns.numpy() < rows, -1 - blocks.numpy(), blocks.numpy())
        shared = shared_memory(device)
        # the few numbers for which rows shared out unevenly leave no room are read where they are
        needed = n * (8 * NUMBERS + 4) + len(pairs) * (9 * precision.numpy.itemsize + 4)
        self._blocks = min(-(-needed // shared), device.sm_count, MOST_BLOCKS, n)
        self._groups = device.sm_count // self._blocks
        starts, lanes, messages = share_rows(offsets.numpy(), self._blocks)
        self._solve, self._begin = persistent_batch_kernels(precision, shared, lanes, messages)
        self._meetings = m = Meetings(n, self._blocks, self._groups, device)
        self._memory = wp.zeros((slots, _SCALARS + _VECTORS * n), dtype=wp.float64, device=device)
        # as of a single solve, the last of which is the curvature: not watched
        self._outcome = wp.zeros((slots, 4), dtype=wp.float64, device=device)
        self._remaining = wp.zeros(1, dtype=int, device=device)
        self._solving = solving
        self._inputs = [
            offsets, columns, wp.array(pairs, dtype=int, device=device), values, diagonal,
            wp.array(starts, dtype=int, device=device), b, x, wp.float64(tolerance), max_iterations, self._memory,
            m.exchange, m.messages, m.scratch, m.control, self._outcome, solving,
        ]  # fmt: skip

    def begin(self, slots: wp.array, count: wp.array) -> None:
        """Let systems of a list of slots begin anew in the next solve."""
        inputs = [slots, count, self._memory, self._solving]
        wp.launch(self._begin, dim=len(self._solving), inputs=inputs, device=self._device, block_dim=THREADS)

    def solve(self, slots: wp.array, count: wp.array, linger: wp.array) -> None:
        """Go on with systems of a list of slots, none of which has ended, until no more than `linger` have not."""
        wp.copy(self._remaining, count)
        wp.launch(
            self._solve,
            dim=self._groups * self._blocks * THREADS,
            inputs=[slots, count, linger, self._remaining, *self._inputs],
            device=self._device,
            block_dim=THREADS,
        )

    def results(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Iterations, residual norms and goals of all slots, of the last system of each that ended.

        Raises
        ------
        SolveError
            If a block did not hear from another.
        """
        self._meetings.check()
        iterations, residual, goal, _ = self._outcome.numpy().T
        return iterations.astype(np.int32), residual.copy(), goal.copy()
