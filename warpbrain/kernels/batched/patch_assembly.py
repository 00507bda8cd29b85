"""Matrices of many samples from their elements on a GPU, through shared memory.

There is a launch for each law, and one that adds up what patches share. A block of threads has a patch of a sample
(`warpbrain.kernels.batched.patches`): it computes the tangents of its elements and adds them up where they are needed
next, so that memory sees no element's tangent, but the sum of those of a patch. The numbers of a sample's matrix are
side by side, as `batched.cluster` wants them.

Tangents are computed in double precision whatever the matrix has: those of nearly incompressible tissue have the
logarithm of a determinant near 1 in them.
"""

from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats
from warpbrain.kernels.batched.cluster import on_device
from warpbrain.kernels.batched.parts import Ints
from warpbrain.kernels.batched.patches import FIRST, SPOKES, Patches, patches_of
from warpbrain.kernels.module import DOUBLE, KernelSet, Precision, compiled_module, native_code
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


@cache
def patch_kernel(law: DeviceLaw, precision: Precision, shared_bytes: int) -> tuple[Any, Any]:
    """Make (once) what the kernel of a law knows, and this kernel."""
    scalar = precision.scalar
    module = compiled_module(f"{law.key}_{precision.name}_patches_{shared_bytes}")
    module.options["block_dim"] = THREADS
    tangents_of = law.kernels(DOUBLE).tangents
    code = native_code(
        "batched/patch.cu", precision, THREADS=THREADS, WIDTH=WIDTH, FIRST=FIRST, BITS=BITS, SPOKES=SPOKES
    )
    # what all native functions begin with, then each with its name before it
    head, *parts = code.split("//// ")
    native = {name: head + part for name, part in (part.split("\n", 1) for part in parts)}
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
