"""Many systems of one pattern in one launch on a GPU whose multiprocessors can form clusters (compute capability 9).

A system has a cluster of blocks of threads, one on each of a few multiprocessors, as many as it takes to keep its
matrix and vectors in their shared memory and registers. It runs plain block-Jacobi conjugate gradients there: at two
barriers an iteration the blocks read each other's sums and neighbouring numbers where they lie (CUDA Programming Guide,
"Distributed Shared Memory"), so that an iteration does not touch the GPU's memory. Who has what is in
`warpbrain.kernels.batched.parts`.

There are as many clusters as systems, and the GPU begins one where another has ended. All sums have an order that
depends on the pattern alone: so a system has the same bits alone and among others.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp

from warpbrain.kernels.batched.parts import ENDS, Parts, Pattern, parts_of
from warpbrain.kernels.module import Precision, compiled_module, native_code
from warpbrain.kernels.persistent import blocks_stay, shared_memory

#: Blocks of a cluster, of which the fewest that have room are taken; and threads of a block.
SIZES, THREADS = (1, 2, 4, 8, 16), 384
#: 32-bit registers of a thread that hold blocks of the matrix: of 168, with what else it needs.
_REGISTERS = 108
#: Bytes of shared memory that are read at a time.
_BANKS = 128
#: Sizes of a kernel are whole multiples of this: meshes of about the same size share it.
_ROUNDED = 32


@wp.struct
class Tables:
    """Of `warpbrain.kernels.batched.parts.Parts`."""

    starts: wp.array[int]
    nodes: wp.array[int]
    outer_starts: wp.array[int]
    outer_nodes: wp.array[int]
    outer_places: wp.array[int]
    pairs: wp.array3d[int]
    columns: wp.array3d[int]
    segment_starts: wp.array2d[int]
    row_segments: wp.array[int]


def on_device(struct: Any, tables: Mapping[str, Any], device: wp.Device) -> Any:
    """A struct of arrays of whole numbers, of tables of these names."""
    made = struct()
    for name in struct.vars:
        setattr(made, name, wp.array(tables[name], dtype=int, device=device))
    return made


def forms_clusters(device: wp.Device) -> bool:
    """Whether blocks of a device can read each other's shared memory; see also `blocks_stay`."""
    return blocks_stay(device) and device.arch >= 90


@dataclass(frozen=True)
class Sizes:
    """Constants of the kernel; see `warpbrain.kernels.batched.parts`.

    `in_registers` and `in_shared` of the places of a thread are kept there.
    """

    cluster: int
    places: int
    in_registers: int
    rows: int
    outers: int
    segments: int

    @property
    def in_shared(self) -> int:
        """Places of a thread in shared memory: at least one, through which those in registers are loaded."""
        return self.places - self.in_registers

    def shared_bytes(self, real: int) -> int:
        """Shared memory of a block, with numbers of so many bytes; as `cluster.cu` lays it out."""
        warps = min(THREADS // 32, -(-self.rows // 32))
        numbers = 9 * self.in_shared * (THREADS + 1) + 15 * self.rows + 3 * self.outers + 3 * self.segments
        return 32 * self.cluster * warps + real * numbers + 2 * (self.places * THREADS + self.rows + 1)


def sizes_of(parts: Parts, real: int) -> Sizes:
    """Constants for a pattern's parts and numbers of so many bytes."""
    rows, outers, segments = (max(1, -(-n // _ROUNDED)) * _ROUNDED for n in (parts.rows, parts.outer, parts.segments))
    in_registers = min(parts.places - 1, 4 * _REGISTERS // (9 * real))
    return Sizes(parts.blocks, parts.places, in_registers, rows, outers, segments)


def fitting_parts(pattern: Pattern, real: int, device: wp.Device) -> Parts | None:
    """Parts for the smallest cluster of a device that keeps a matrix of numbers of `real` bytes, or None."""
    shared_bytes = shared_memory(device)
    for blocks in SIZES if forms_clusters(device) else ():
        # without more ado where not even the matrix has room
        if 9 * real * len(pattern.columns) > blocks * (shared_bytes + 4 * _REGISTERS * THREADS):
            continue
        if np.count_nonzero(pattern.active) < blocks:
            break
        parts = parts_of(pattern, blocks, THREADS, _BANKS // real)
        sizes = sizes_of(parts, real)
        if sizes.rows + sizes.outers < ENDS and sizes.shared_bytes(real) <= shared_bytes:
            return parts
    return None


@cache
def cluster_kernel(precision: Precision, sizes: Sizes) -> tuple[Any, Any]:
    """Make (once) what the kernel knows of systems, and this kernel."""
    scalar, vec3 = precision.scalar, precision.vec3
    name = "_".join(str(size) for size in vars(sizes).values())
    module = compiled_module(f"cluster_{precision.name}_{name}")
    module.options["block_dim"] = THREADS
    numbers = wp.constant(-(-sizes.shared_bytes(precision.numpy.itemsize) // 8))

    @wp.struct
    class Systems:
        ahead: int  # about as many are under way at a time
        parts: Tables
        diagonal: wp.array[int]
        pair_count: int
        values: wp.array3d[scalar]
        b: wp.array3d[scalar]
        v: wp.array3d[scalar]
        free: wp.array[vec3]
        x: wp.array3d[scalar]
        max_iterations: int
        outcome: wp.array2d[wp.float64]

    constants = {name.upper(): size for name, size in vars(sizes).items()}
    code = native_code("batched/cluster.cu", precision, THREADS=THREADS, IN_SHARED=sizes.in_shared, **constants)

    @wp.func_native(code)
    def solve(slots: wp.array[int], count: wp.array[int], given: Systems, tolerance: wp.float64): ...

    @wp.kernel(module=module, launch_bounds=(THREADS, 1), cluster_dim=sizes.cluster, grid_stride=False)
    def conjugate_gradients(slots: wp.array[int], count: wp.array[int], given: Systems, tolerance: wp.float64):
        # all of the shared memory: the native code knows where it begins
        wp.tile_empty(shape=numbers, dtype=wp.float64, storage="shared")
        solve(slots, count, given, tolerance)

    return Systems, conjugate_gradients
