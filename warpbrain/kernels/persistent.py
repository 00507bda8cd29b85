"""Conjugate gradients as one launch on a GPU, in which all blocks stay and talk to each other.

A launch takes some two microseconds even in a graph, and conjugate gradients of a brain's mesh would have nine of them an
iteration for half a microsecond's worth of work. Here a block has rows of the matrix for the whole solve, on its
multiprocessor as far as they fit (PERKS: Zhang et al. 2023, doi 10.1145/3577193.3593705), and all blocks meet once an
iteration: pipelined conjugate gradients (Ghysels and Vanroose 2014, Parallel Computing 40, 224, algorithm 4) need the sums
and the neighbours' numbers at the same time. Their recurrences lose digits, so they start again from the residual itself
every so often (Cools, Cornelis and Vanroose 2019, doi 10.1016/j.parco.2019.05.002), and it is that which has to reach the
tolerance in the end. Vectors and sums are double in either precision.

**Meetings.** No more blocks than multiprocessors, one on each: all run at once. Each block writes its sums, labelled with the
number of the meeting, and waits for those of all others, which it adds in one order: the same bits every time. A block
that hears nothing for two seconds gives up, and so do then all; `PersistentSolve.outcome` says so.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
import warp as wp
from warp.sparse import BsrMatrix

from warpbrain.errors import SolveError
from warpbrain.kernels.module import compiled_module
from warpbrain.kernels.precision import Precision

#: Threads of a block, and how many of them share a row.
THREADS, LANES = 1024, 8
#: What a kernel has of a multiprocessor's shared memory without asking for it [bytes].
_RESERVED = 6 * 1024
#: Numbers that a row of the matrix keeps, eight vectors of three components and an inverse diagonal block.
_KEPT = 33
#: Rows that a block has at least, unless there are fewer: what two blocks say to each other takes longer than these.
_LEAST_ROWS = 8


@cache
def persistent_kernel(precision: Precision, shared_bytes: int, threads: int = THREADS, lanes: int = LANES) -> Any:
    """Make (once) the kernel for blocks with so much shared memory; launched over ``blocks * threads``."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    real = {"double": "double", "single": "float"}[precision.name]
    module = compiled_module(f"persistent_{precision.name}_{shared_bytes}_{threads}_{lanes}")
    module.options["block_dim"] = threads
    numbers = wp.constant(shared_bytes // 8)
    constants = (
        f"using REAL = {real};\n"
        f"constexpr int THREADS = {threads}, LANES = {lanes}, SHARED_BYTES = {shared_bytes};\n"
        f"constexpr double ROUNDING = {precision.epsilon!r};\n"
    )

    @wp.func_native(constants + files("warpbrain.kernels").joinpath("persistent.cu").read_text(encoding="utf-8"))
    def solve(
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[mat33],
        diagonal: wp.array[int],
        starts: wp.array[int],
        b: wp.array[vec3],
        x: wp.array[vec3],
        tolerance: wp.float64,
        max_iterations: int,
        watch: int,
        jacobi: int,
        exchange: wp.array[wp.float64],
        messages: wp.array[wp.uint64],
        scratch: wp.array[wp.float64],
        control: wp.array[int],
        outcome: wp.array[wp.float64],
    ): ...

    @wp.kernel(module=module, launch_bounds=(threads, 1), grid_stride=False)
    def conjugate_gradients(
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[mat33],
        diagonal: wp.array[int],
        starts: wp.array[int],
        b: wp.array[vec3],
        x: wp.array[vec3],
        tolerance: wp.float64,
        max_iterations: int,
        watch: int,
        jacobi: int,
        exchange: wp.array[wp.float64],
        messages: wp.array[wp.uint64],
        scratch: wp.array[wp.float64],
        control: wp.array[int],
        outcome: wp.array[wp.float64],
    ):
        # all of the shared memory: the native code knows where it begins
        memory = wp.tile_empty(shape=numbers, dtype=wp.float64, storage="shared")
        solve(
            offsets, columns, values, diagonal, starts, b, x, tolerance, max_iterations, watch, jacobi, exchange,
            messages, scratch, control, outcome,
        )  # fmt: skip

    return conjugate_gradients
