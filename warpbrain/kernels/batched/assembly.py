"""From elements to the systems of many samples: ordered sums into nodes and into the blocks of each matrix.

The matrices are symmetric: the blocks `A_ij` with i <= j are kept, one for each pair of nodes that share an element.
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.batched.layout import ROWS, store_block, store_vector, tangent_of, vector_of
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.precision import Precision

#: Samples and pairs of nodes of a block of threads that puts the numbers of each sample side by side.
_LANES, _PAIRS = 64, 2


@cache
def _matrix_block(precision: Precision) -> Any:
    """Make (once) the device function of a block `A_ij = k K_ij + m M_ij` of a slot, with `k` and `m` of the sample and
    the rows and columns of constrained components replaced by those of the identity."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33

    @wp.func
    def matrix_block(
        p: int,
        slot: int,
        pairs: wp.array[wp.vec2i],
        first: wp.array[int],
        contributions: wp.array[int],
        tangents: wp.array3d[scalar],
        mass: wp.array[scalar],
        free: wp.array[vec3],
        k: wp.array[scalar],
        m: wp.array[scalar],
    ):
        K = mat33()
        for c in range(first[p], first[p + 1]):
            K += tangent_of(tangents, contributions[c] / 10, contributions[c] % 10, slot)
        i = pairs[p][0]
        j = pairs[p][1]
        A = wp.cw_mul(k[slot] * K, wp.outer(free[i], free[j]))
        if i == j:
            one = scalar(1.0)
            inertia = m[slot] * mass[i]
            for c in range(3):
                A[c, c] += free[i][c] * inertia + (one - free[i][c])
        return A

    return matrix_block


@cache
def batched_assembly_kernels(precision: Precision) -> KernelSet:
    """Make (once) the batched assembly kernels of a precision; the last index of each is a lane."""
    scalar, vec3 = precision.scalar, precision.vec3
    kernels = KernelSet(f"assembly_{precision.name}_batched")
    rows = wp.constant(ROWS)
    matrix_block = _matrix_block(precision)

    @kernels.add
    def gather_matrix(
        slots: wp.array[int],
        count: wp.array[int],
        pairs: wp.array[wp.vec2i],
        first: wp.array[int],
        contributions: wp.array[int],
        tangents: wp.array3d[scalar],
        mass: wp.array[scalar],
        free: wp.array[vec3],
        k: wp.array[scalar],
        m: wp.array[scalar],
        values: wp.array3d[scalar],
    ):
        """One thread for a pair of nodes."""
        p, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        A = matrix_block(p, slot, pairs, first, contributions, tangents, mass, free, k, m)
        store_block(values, p, 0, slot, A)

    @kernels.add
    def gather_forces(
        slots: wp.array[int],
        count: wp.array[int],
        first: wp.array[int],
        corners: wp.array[int],
        element_forces: wp.array3d[scalar],
        external: wp.array[vec3],
        free: wp.array[vec3],
        internal: wp.array3d[scalar],
        shares: wp.array3d[scalar],
    ):
        """One thread for `ROWS` nodes: internal forces, and the shares of the squared norms of what is out of balance
        on the free components and of the internal forces."""
        chunk, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        unbalanced = scalar(0.0)
        size = scalar(0.0)
        for i in range(chunk * rows, wp.min((chunk + 1) * rows, internal.shape[0])):
            f = vec3()
            for c in range(first[i], first[i + 1]):
                f += vector_of(element_forces, corners[c], slot)
            store_vector(internal, i, slot, f)
            lack = wp.cw_mul(free[i], external[i] - f)
            unbalanced += wp.dot(lack, lack)
            size += wp.dot(f, f)
        shares[0, chunk, slot] = unbalanced
        shares[1, chunk, slot] = size

    @kernels.add
    def smallest(
        slots: wp.array[int], count: wp.array[int], size: int, values: wp.array2d[scalar], least: wp.array2d[scalar]
    ):
        """One thread for a share of the elements: their smallest `J`, NaN if one is."""
        chunk, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        low = values[chunk * size, slot]
        for i in range(chunk * size + 1, wp.min((chunk + 1) * size, values.shape[0])):
            value = values[i, slot]
            # once NaN, for ever NaN
            if low == low and not (value >= low):
                low = value
        least[chunk, slot] = low

    @kernels.add
    def constrained_load(
        slots: wp.array[int],
        count: wp.array[int],
        first: wp.array[int],
        corners: wp.array[int],
        nodes: wp.array[wp.vec4i],
        tangents: wp.array3d[scalar],
        velocity: wp.array3d[scalar],
        free: wp.array[vec3],
        k: wp.array[scalar],
        load: wp.array3d[scalar],
    ):
        """One thread for a node: subtract `k K d`, of prescribed velocities `d`, from the right-hand side."""
        i, lane = wp.tid()
        if lane >= count[0]:
            return
        slot = slots[lane]
        f = vec3()
        for c in range(first[i], first[i + 1]):
            e = corners[c] / 4
            a = corners[c] % 4
            for b in range(4):
                low = wp.min(a, b)
                high = wp.max(a, b)
                # position of the pair in the ten blocks
                K = tangent_of(tangents, e, low * 4 - low * (low + 1) / 2 + high, slot)
                if a > b:
                    K = wp.transpose(K)
                f += K * vector_of(velocity, nodes[e][b], slot)
        store_vector(load, i, slot, vector_of(load, i, slot) - wp.cw_mul(free[i], k[slot] * f))

    return kernels


#: Through shared memory, so that threads beside each other write to places beside each other in `values`, whose numbers
#: of a slot are side by side.
_STORE = """
constexpr int WIDE = 9 * PAIRS, STRIDE = WIDE + 1;
__shared__ REAL tile[LANES * STRIDE];
const int lane = threadIdx.x % LANES, pair = threadIdx.x / LANES;
for (int e = 0; e < 9; ++e)
    tile[lane * STRIDE + 9 * pair + e] = A.data[e / 3][e % 3];
__syncthreads();
const size_t all = 9 * size_t(values.shape[0]);
for (int i = threadIdx.x; i < LANES * WIDE; i += LANES * PAIRS) {
    const int to = lane0 + i / WIDE;
    const size_t at = 9 * size_t(p0) + i % WIDE;
    if (to < count.data[0] && at < all)
        values.data[slots.data[to] * all + at] = tile[i / WIDE * STRIDE + i % WIDE];
}
__syncthreads();
"""


def tiles_of(pairs: int, slots: int) -> tuple[int, int, int, int]:
    """What `batched_system_gather` is launched over, in blocks of `_PAIRS` times `_LANES` threads."""
    return -(-pairs // _PAIRS), -(-slots // _LANES), _PAIRS, _LANES


@cache
def batched_system_gather(precision: Precision) -> Any:
    """Make (once) what does what `gather_matrix` does where the numbers of a slot are side by side, on a GPU."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"assembly_{precision.name}_systems")
    matrix_block = _matrix_block(precision)
    lanes, rows = wp.constant(_LANES), wp.constant(_PAIRS)
    real = {"double": "double", "single": "float"}[precision.name]

    @wp.func_native(f"using REAL = {real};\nconstexpr int LANES = {_LANES}, PAIRS = {_PAIRS};\n{_STORE}")
    def store(
        values: wp.array3d[scalar], slots: wp.array[int], count: wp.array[int], p0: int, lane0: int, A: mat33
    ): ...

    @kernels.add
    def gather_systems(
        slots: wp.array[int],
        count: wp.array[int],
        pairs: wp.array[wp.vec2i],
        first: wp.array[int],
        contributions: wp.array[int],
        tangents: wp.array3d[scalar],
        mass: wp.array[scalar],
        free: wp.array[vec3],
        k: wp.array[scalar],
        m: wp.array[scalar],
        values: wp.array3d[scalar],
    ):
        """One thread for a pair of nodes and a lane; see `tiles_of`."""
        tile, group, row, column = wp.tid()
        p = tile * rows + row
        lane = group * lanes + column
        A = mat33()
        if p < pairs.shape[0] and lane < count[0]:
            A = matrix_block(p, slots[lane], pairs, first, contributions, tangents, mass, free, k, m)
        store(values, slots, count, tile * rows, group * lanes, A)

    return kernels.gather_systems
