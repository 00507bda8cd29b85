"""Conjugate gradients as one launch on a GPU, in which all blocks stay and talk to each other.

A launch takes some two microseconds even in a graph, and conjugate gradients of a brain's mesh would have nine of them
an iteration for half a microsecond of work. Here a block has its rows of the matrix for the whole solve, on its
multiprocessor as far as they fit (PERKS: Zhang et al. 2023, doi 10.1145/3577193.3593705), and all blocks meet once an
iteration: pipelined conjugate gradients (Ghysels and Vanroose 2014, Parallel Computing 40, 224, algorithm 4) need the
sums and the numbers of neighbours at the same time. Their recurrences lose digits. So they start again from the
residual itself every so often, with the search direction kept (Cools, Yetkin, Agullo, Giraud and Vanroose 2018, SIAM J.
Matrix Anal. Appl. 39, 426), long solves go over to textbook conjugate gradients, and it is the residual itself that has
to reach the tolerance in the end. Vectors and sums are double in either precision.

**Meetings.** There are no more blocks than multiprocessors, and each of these has room for one: all run at once. A
block writes its sums, labelled with the number of the meeting, and one of its warps waits for those of all others and
adds them in one order: the same bits every time. Numbers for neighbours are labelled, too: the other warps need no
fence to multiply them meanwhile. A block that does not hear from another for two seconds gives up, then all do, and
`warpbrain.kernels.linear.OneLaunchGradient` raises: nothing hangs.
"""

import os
from functools import cache
from typing import Any

import numpy as np
import warp as wp

from warpbrain.arrays import Int32s
from warpbrain.kernels.module import Precision, compiled_module, native_code

#: Threads of a block that have rows, and how many of them may share one: the most with which all rows are under way at
#: once. One more warp adds up the sums of all blocks.
_WORKERS, _LANES = 480, (16, 8, 4)
#: Threads of a block.
THREADS = _WORKERS + 32
#: What a kernel has of a multiprocessor's shared memory without asking for it [bytes].
_RESERVED = 6 * 1024
#: Numbers of a row beside the matrix: ten vectors of three components and half an inverse diagonal block.
NUMBERS = 36
#: Sums of a meeting; a message is one, and the number of the meeting.
SUMS = 4
#: Blocks that may meet.
_MOST_BLOCKS = 256
#: Rows that a block has at least, unless there are fewer: what more blocks say to each other takes longer than these.
_LEAST_ROWS = 32


@cache
def persistent_kernel(precision: Precision, shared_bytes: int, lanes: int, messages: int) -> tuple[Any, Any]:
    """Make (once) what the kernel of a solve knows, and this kernel.

    `lanes` threads have a row, and a thread of the last warp has `messages`.
    """
    vec3, mat33 = precision.vec3, precision.mat33
    module = compiled_module(f"persistent_{precision.name}_{shared_bytes}_{lanes}_{messages}")
    module.options["block_dim"] = THREADS
    numbers = wp.constant(shared_bytes // 8)

    @wp.struct
    class Solve:
        offsets: wp.array[int]
        columns: wp.array[int]
        values: wp.array[mat33]
        diagonal: wp.array[int]
        starts: wp.array[int]
        b: wp.array[vec3]
        x: wp.array[vec3]
        max_iterations: int
        watch: int
        exchange: wp.array[wp.float64]
        messages: wp.array[wp.uint64]
        scratch: wp.array[wp.float64]
        control: wp.array[int]
        outcome: wp.array[wp.float64]

    code = native_code(
        "persistent.cu", precision, THREADS=THREADS, LANES=lanes, MESSAGES=messages, SHARED_BYTES=shared_bytes,
        ROUNDING=precision.epsilon,
    )  # fmt: skip

    @wp.func_native(code)
    def solve(given: Solve, tolerance: wp.float64): ...

    @wp.kernel(module=module, launch_bounds=(THREADS, 1), grid_stride=False)
    def conjugate_gradients(given: Solve, tolerance: wp.float64):
        # all of the shared memory: the native code knows where it begins
        wp.tile_empty(shape=numbers, dtype=wp.float64, storage="shared")
        solve(given, tolerance)

    return Solve, conjugate_gradients


def blocks_stay(device: wp.Device) -> bool:
    """Whether blocks of a device can wait for each other: on a GPU since Volta, unless the environment forbids it.

    ``WARPBRAIN_PERSISTENT=0`` is for GPUs of which another program holds multiprocessors for good.
    """
    return bool(device.is_cuda and device.arch >= 70 and os.environ.get("WARPBRAIN_PERSISTENT", "1") != "0")


def shared_memory(device: wp.Device) -> int:
    """What a block may have of a multiprocessor's shared memory [bytes]."""
    return int(device.max_shared_memory_per_block - _RESERVED) // 8 * 8


def share_rows(offsets: Int32s, multiprocessors: int) -> tuple[Int32s, int, int]:
    """First row of each block, by the entries (n + 1,) of rows; how many threads share a row; messages for a thread."""
    blocks = max(1, min(multiprocessors, _MOST_BLOCKS, (len(offsets) - 1) // _LEAST_ROWS))
    starts = np.searchsorted(offsets, np.linspace(0, offsets[-1], blocks + 1)).astype(np.int32)
    starts[0], starts[-1] = 0, len(offsets) - 1
    rows = int(np.max(np.diff(starts)))
    lanes = next((lanes for lanes in _LANES if rows * lanes <= _WORKERS), _LANES[-1])
    return starts, lanes, -(-blocks * SUMS // 32)
