"""Kernels that make matrices of many samples from their elements on a GPU, through shared memory.

A block of threads has a patch of a sample (`warpbrain.kernels.batched.patches`): it computes the tangents of its
elements and adds them up where they are needed next, so that memory sees no element's tangent, but the sum of those of
a patch. The numbers of a sample's matrix are side by side, as `batched.cluster` wants them.

Tangents are computed in double precision whatever the matrix has: those of nearly incompressible tissue have the
logarithm of a determinant near 1 in them.
"""

from functools import cache
from importlib.resources import files
from typing import Any

import warp as wp

from warpbrain.kernels.batched.patches import FIRST, SPOKES
from warpbrain.kernels.module import DOUBLE, KernelSet, Precision, compiled_module
from warpbrain.kernels.tetrahedron import DeviceLaw

#: Threads of a block, how many of these are at a round's elements, and blocks that share a multiprocessor: of these and
#: their neighbours the fastest on an H200, for most laws in either precision.
THREADS, WIDTH, TOGETHER = 192, 96, 2
#: What a block has of shared memory without asking for it, and what Warp's own variables may take [bytes].
_RESERVED = 1024
#: Of a row: what is free in it and `FIRST`, behind its number.
BITS = 10


@wp.struct
class Tables:
    """Of `warpbrain.kernels.batched.patches.Patches`; `PatchAssembly` says what is packed how."""

    batch_starts: wp.array[int]
    places: wp.array3d[int]
    edge_counts: wp.array[int]
    node_starts: wp.array[int]
    nodes: wp.array[int]
    spoke_starts: wp.array[int]
    spokes: wp.array[int]
    row_starts: wp.array[int]
    rows: wp.array[int]


def block_bytes(shared_bytes: int) -> int:
    """Of shared memory for a patch, where a block may have so much."""
    return shared_bytes // TOGETHER // 8 * 8 - _RESERVED


@wp.func
def front_of(edges: int, nodes: int):
    """Numbers of eight bytes before a patch's matrix: displacements, in whose place spokes of two bytes come."""
    return wp.max(3 * nodes, (2 * edges + 4 * nodes + 4) / 4)


def fits(edges: int, nodes: int, real: int, room: int) -> bool:
    """Whether a patch has room in so many bytes, with numbers of `real` bytes: what `front_of` says, and its matrix."""
    return 9 * real * (edges + 1) + 8 * max(3 * nodes, (2 * edges + 4 * nodes + 4) // 4) <= room


def native_code(precision: Precision) -> dict[str, str]:
    """What native functions consist of, by their names."""
    real = {"double": "double", "single": "float"}[precision.name]
    text = files("warpbrain.kernels.batched").joinpath("patch.cu").read_text(encoding="utf-8")
    parts = dict(part.split("\n", 1) for part in text.split("//// ")[1:])
    head = (
        f"using REAL = {real};\nconstexpr int THREADS = {THREADS}, WIDTH = {WIDTH}, FIRST = {FIRST}, "
        f"BITS = {BITS}, SPOKES = {SPOKES};\n"
    )
    return {name: head + parts["all"] + part for name, part in parts.items()}


@cache
def patch_kernel(law: DeviceLaw, precision: Precision, shared_bytes: int) -> tuple[Any, Any]:
    """Make (once) what the kernel of a law knows, and this kernel."""
    scalar = precision.scalar
    module = compiled_module(f"{law.key}_{precision.name}_patches_{shared_bytes}")
    module.options["block_dim"] = THREADS
    tangents_of, native = law.kernels(DOUBLE).tangents, native_code(precision)
    numbers = wp.constant(block_bytes(shared_bytes) // 8)

    @wp.struct
    class Patched:
        tables: Tables
        geometry: wp.array3d[wp.float64]
        parameters: wp.array2d[wp.float64]
        u: wp.array3d[wp.float64]
        mass: wp.array[scalar]
        values: wp.array3d[scalar]
        extras: wp.array3d[scalar]

    @wp.func_native(native["enter"])
    def enter(patch: int, slot: int, front: int, edges: int, of: Patched): ...

    @wp.func_native(native["edge"])
    def edge(from_: int, to: int) -> wp.vec3d: ...  # type: ignore[empty-body]

    @wp.func_native(native["add"])
    def add(
        front: int,
        first: int,
        second: int,
        third: int,
        K01: wp.mat33d,
        K02: wp.mat33d,
        K03: wp.mat33d,
        K12: wp.mat33d,
        K13: wp.mat33d,
        K23: wp.mat33d,
    ): ...

    @wp.func_native(native["leave"])
    def leave(patch: int, slot: int, front: int, edges: int, of: Patched, stiffness: scalar, inertia: scalar): ...

    @wp.kernel(module=module, launch_bounds=(THREADS, TOGETHER), grid_stride=False)
    def assemble(slots: wp.array[int], count: wp.array[int], k: wp.array[scalar], m: wp.array[scalar], of: Patched):
        """One block for a lane and a patch; see `PatchAssembly`."""
        # all of the shared memory: the native code knows where it begins
        wp.tile_empty(shape=numbers, dtype=wp.float64, storage="shared")
        lane, patch, t = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        edges = of.tables.edge_counts[patch]
        front = front_of(edges, of.tables.node_starts[patch + 1] - of.tables.node_starts[patch])
        enter(patch, slot, front, edges, of)
        for batch in range(of.tables.batch_starts[patch], of.tables.batch_starts[patch + 1]):
            ab = of.tables.places[batch, 0, t]
            cd = of.tables.places[batch, 1, t]
            tissue = of.tables.places[batch, 5, t]
            G = wp.mat33d(
                of.geometry[batch, 0, t], of.geometry[batch, 1, t], of.geometry[batch, 2, t],
                of.geometry[batch, 3, t], of.geometry[batch, 4, t], of.geometry[batch, 5, t],
                of.geometry[batch, 6, t], of.geometry[batch, 7, t], of.geometry[batch, 8, t],
            )  # fmt: skip
            V = of.geometry[batch, 9, t]
            a = ab & 0xFFFF
            E = wp.matrix_from_cols(edge(a, ab >> 16), edge(a, cd & 0xFFFF), edge(a, cd >> 16))
            F = E * G + wp.identity(n=3, dtype=wp.float64)
            _, K11, K12, K13, K22, K23, K33 = tangents_of(F, G, V, of.parameters, tissue * of.u.shape[2] + slot)
            # each row of blocks sums to zero
            K01 = -(K11 + wp.transpose(K12) + wp.transpose(K13))
            K02 = -(K12 + K22 + wp.transpose(K23))
            K03 = -(K13 + K23 + K33)
            add(
                front, of.tables.places[batch, 2, t], of.tables.places[batch, 3, t], of.tables.places[batch, 4, t],
                K01, K02, K03, K12, K13, K23,
            )  # fmt: skip
        leave(patch, slot, front, edges, of, k[slot], m[slot])

    return Patched, assemble


@cache
def sum_kernel(precision: Precision) -> Any:
    """Make (once) the kernel that adds up what several patches have of a pair."""
    scalar = precision.scalar
    kernels = KernelSet(f"patch_sums_{precision.name}")

    @kernels.add
    def add_extras(
        slots: wp.array[int],
        count: wp.array[int],
        pairs: wp.array[int],
        starts: wp.array[int],
        extras: wp.array3d[scalar],
        values: wp.array3d[scalar],
    ):
        lane, i, e = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        total = values[pairs[i], e, slot]
        for row in range(starts[i], starts[i + 1]):
            total += extras[row, e, slot]
        values[pairs[i], e, slot] = total

    return kernels.add_extras
