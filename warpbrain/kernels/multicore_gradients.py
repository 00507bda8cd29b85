"""Conjugate gradients as one kernel that all cores of a CPU run together.

Hestenes and Stiefel's recurrences (1952), as `warp.optim.linear.CG` has them, in three passes over the rows an
iteration where Warp makes nine, and without its kernels, which take longer to compile than all others of a run. Sums
are over chunks of rows, then over chunks in order: they do not depend on the number of threads.

The preconditioner has one level or two: the inverse diagonal blocks, and what an affine motion of each of some
aggregates, runs of neighbouring rows, takes off the residual (an additive coarse space as of Nicolaides 1987, SIAM J.
Numer. Anal. 24, 355, with the modes of a linear strain). Block-Jacobi needs hundreds of iterations for what is smooth.

Each thread has rows of its own, which stay in its cache, in `_SHARES` shares; who is through with these takes what
others have not come to. Whoever does the last share of a pass adds up and lets the next pass begin.
"""

from functools import cache
from typing import Any, TypeAlias

import warp as wp

from warpbrain.kernels.module import SINGLE, KernelSet, Precision
from warpbrain.kernels.multicore import PAUSE

#: Rows that are summed before anything is added to them.
CHUNK = 64

#: Shares that the rows of a thread are in.
_SHARES = 4
# Words of `sync`, each alone on a cache line: the pass, shares of it that are done, whether all is over, and of each
# thread the pass and how many of its shares were taken. A pass is that of the start, then by turns the coarse space,
# the new direction, the product and the step.
_LINE = 8
_PASS, _DONE, _OVER, _TAKEN = (line * _LINE for line in range(4))
_START, _COARSE, _DIRECTION, _PRODUCT, _STEP = range(5)


def sync_words(threads: int) -> int:
    """Words (64 bits) of `sync`; all are zero before a solve."""
    return _TAKEN + threads * _LINE


_WORDS = """
    typedef unsigned long long word;
    word* words = (word*)sync;
"""


@wp.func_native(
    PAUSE
    + _WORDS
    + f"""
    for (unsigned tries = 0;; pause(tries)) {{
        for (int turn = 0; turn < threads; ++turn) {{
            const int owner = (thread + turn) % threads;
            word* taken = words + {_TAKEN} + {_LINE} * owner;
            if ((__atomic_load_n(taken, __ATOMIC_ACQUIRE) & 0xffffffff) >= {_SHARES}) continue;
            const word mine = __atomic_fetch_add(taken, 1, __ATOMIC_ACQ_REL);
            if ((mine & 0xffffffff) >= {_SHARES}) continue;
            const word pass = mine >> 32;
            const int kind = pass ? 1 + (int)((pass - 1) % 4) : {_START};
            return kind * threads * {_SHARES} + owner * {_SHARES} + (int)(mine & 0xffffffff);
        }}
        if (__atomic_load_n(words + {_OVER}, __ATOMIC_ACQUIRE)) return -1;
    }}
    """
)
def _take(thread: int, threads: int, sync: wp.uint64, give_way: wp.uint64) -> int:  # type: ignore[empty-body]
    """A share of the present pass and the kind of the pass, as one number; -1 when all is over."""


@wp.func_native(
    _WORDS
    + f"""
    return __atomic_fetch_add(words + {_DONE}, 1, __ATOMIC_ACQ_REL) + 1 == (word)(threads * {_SHARES});
    """
)
def _is_last(threads: int, sync: wp.uint64) -> bool:  # type: ignore[empty-body]
    """A share is done; whether it was the last of the pass."""


@wp.func_native(
    _WORDS
    + f"""
    if (!go_on) {{
        __atomic_store_n(words + {_OVER}, 1, __ATOMIC_RELEASE);
        return;
    }}
    words[{_DONE}] = 0;
    const word pass = ++words[{_PASS}];
    for (int owner = 0; owner < threads; ++owner)
        __atomic_store_n(words + {_TAKEN} + {_LINE} * owner, pass << 32, __ATOMIC_RELEASE);
    """
)
def _begin_pass(threads: int, sync: wp.uint64, go_on: bool):
    """Let the next pass begin, or end."""


def _rows(precision: Precision, stored: Precision) -> str:
    """Native code: `row(k, c)` is row `c` of block `k` of `values`, in lanes of a vector, one of which is not used."""
    return f"""
        typedef {precision.native} number;
        typedef number lanes __attribute__((vector_size(4 * sizeof(number)), aligned(sizeof(number)), may_alias));
        typedef {stored.native} stored;
        typedef stored blocks __attribute__((vector_size(4 * sizeof(stored)), aligned(sizeof(stored)), may_alias));
        auto row = [&](int k, int c) {{
            const stored* A = &values.data[k].data[c][0];
            // beyond the last row there may be nothing
            const blocks loaded = c < 2 ? *(const blocks*)A : blocks{{A[0], A[1], A[2], 0}};
            return __builtin_convertvector(loaded, lanes);
        }};
    """


def _row_product(precision: Precision, stored: Precision) -> Any:
    """``(offsets, columns, values, x, i) -> A_i x`` in lanes of vectors, since Warp multiplies number by number."""
    vec3, mat33 = precision.vec3, stored.mat33

    @wp.func_native(
        _rows(precision, stored)
        + """
        lanes sx = {0, 0, 0, 0}, sy = sx, sz = sx;
        for (int k = offsets.data[i]; k < offsets.data[i + 1]; ++k) {
            const number* v = &x.data[columns.data[k]].c[0];
            const lanes along = {v[0], v[1], v[2], 0};
            sx += row(k, 0) * along;
            sy += row(k, 1) * along;
            sz += row(k, 2) * along;
        }
        return {sx[0] + sx[1] + sx[2], sy[0] + sy[1] + sy[2], sz[0] + sz[1] + sz[2]};
        """
    )
    def row_product(
        offsets: wp.array[int], columns: wp.array[int], values: wp.array[mat33], x: wp.array[vec3], i: int
    ) -> vec3: ...

    return row_product


def _coarse_functions(precision: Precision) -> tuple[Any, Any]:
    """Of the coarse space, of aggregates of `size` rows, likewise.

    ``(A, x, i) -> A_i x`` of a full matrix, columns a multiple of four; and ``(offsets, columns, values, size, free,
    places, coarse, i)``, which adds a row to the matrix. Columns of constrained components are zero, but in their own
    rows.
    """
    scalar, vec3 = precision.scalar, precision.vec3

    @wp.func_native(
        f"""
        typedef {precision.native} number;
        typedef number lanes __attribute__((vector_size(4 * sizeof(number)), aligned(sizeof(number)), may_alias));
        const int columns = x.shape[0];
        const lanes *row = (const lanes*)(A.data + (size_t)i * columns), *v = (const lanes*)x.data;
        // two sums, which do not wait for each other
        lanes even = {{0, 0, 0, 0}}, odd = even;
        for (int q = 0; q < columns / 4; ++q) (q % 2 ? odd : even) += row[q] * v[q];
        even += odd;
        return even[0] + even[1] + even[2] + even[3];
        """
    )
    def full_row_product(A: wp.array2d[scalar], x: wp.array[scalar], i: int) -> scalar: ...

    @wp.func_native(
        _rows(precision, SINGLE)
        + """
        lanes* to = (lanes*)(coarse.data + (size_t)(i / size) * coarse.shape[1]);
        auto weight = [&](int node, int mode) { return mode ? places.data[node].c[mode - 1] : number(1); };
        // what motions of an aggregate do to the row, summed as long as the next column is of the same
        int of = i / size;
        lanes s[4][3] = {};
        auto add = [&]() {
            for (int mode = 0; mode < 4; ++mode)
                for (int c = 0; c < 3; ++c)
                    for (int other = 0; other < 4; ++other)
                        to[48 * of + 12 * mode + 4 * c + other] += weight(i, mode) * free.data[i].c[c] * s[other][c];
        };
        for (int k = offsets.data[i]; k < offsets.data[i + 1]; ++k) {
            const int j = columns.data[k];
            if (j / size != of) {
                add();
                of = j / size;
                for (auto& block : s)
                    for (lanes& summed : block) summed = lanes{0, 0, 0, 0};
            }
            for (int other = 0; other < 4; ++other)
                for (int c = 0; c < 3; ++c) s[other][c] += weight(j, other) * row(k, c);
        }
        add();
        """
    )
    def add_to_coarse(
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[wp.mat33f],
        size: int,
        free: wp.array[vec3],
        places: wp.array[vec3],
        coarse: wp.array2d[scalar],
        i: int,
    ): ...

    return full_row_product, add_to_coarse


@cache
def coarse_space_struct(precision: Precision) -> Any:
    """Make (once) what the kernels of a precision know of a coarse space of `k` aggregates."""
    scalar, vec3 = precision.scalar, precision.vec3

    @wp.struct
    class CoarseSpace:
        aggregate: int  # chunks of rows
        free: wp.array[vec3]  # 1 where a component is
        places: wp.array[vec3]  # of nodes
        inverse: wp.array2d[scalar]  # (12 k, 12 k)
        residual: wp.array[scalar]  # (12 k,)
        solution: wp.array[scalar]
        restricted: wp.array2d[vec3]  # (chunks, 4), scratch

    return CoarseSpace


@cache
def gradients_kernels(precision: Precision) -> KernelSet:
    """Make (once) the kernels of a precision: `conjugate_gradients`, `coarse_matrix` of the coarse space, `copy_blocks`
    at places in single precision, and `multiply`.

    `warpbrain.kernels.multicore.launch_together` runs the first. Its arguments after those of the threads: the
    addresses of `sync` and of what gives way; the matrix by `offsets`, `columns` and `values`, or a `copy` of these in
    single precision if there is one; the `inverse` diagonal blocks; `b`; `x`, the first guess and the result; `r`, `p`
    and `Ap`, scratch like `x`; `partial` (chunks, 4), scratch; the relative `tolerance`; the most iterations; whether
    to end where the matrix is seen not to be positive definite; `outcome` (8,): iterations, squares of the norm of the
    residual and of its goal, the least `p . A p / p . p`, and four numbers of the recurrences; and the `CoarseSpace`,
    without arrays if there is none.
    """
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"multicore_gradients_{precision.name}")
    CoarseSpace: TypeAlias = coarse_space_struct(precision)
    chunk, shares = wp.constant(CHUNK), wp.constant(_SHARES)
    start, coarse, direction = wp.constant(_START), wp.constant(_COARSE), wp.constant(_DIRECTION)
    product = wp.constant(_PRODUCT)
    row_product, copied_row_product = _row_product(precision, precision), _row_product(precision, SINGLE)
    full_row_product, add_to_coarse = _coarse_functions(precision)

    @wp.func
    def total(partial: wp.array2d[scalar], column: int):
        s = scalar(0.0)
        for t in range(partial.shape[0]):
            s += partial[t, column]
        return s

    @wp.func
    def vector_at(x: wp.array[scalar], i: int):
        return vec3(x[i], x[i + 1], x[i + 2])

    @wp.func
    def restrict(t: int, r: wp.array[vec3], space: CoarseSpace):
        s = vec3()
        sx = vec3()
        sy = vec3()
        sz = vec3()
        for i in range(t * chunk, wp.min((t + 1) * chunk, r.shape[0])):
            moved = wp.cw_mul(space.free[i], r[i])
            place = space.places[i]
            s += moved
            sx += place[0] * moved
            sy += place[1] * moved
            sz += place[2] * moved
        space.restricted[t, 0] = s
        space.restricted[t, 1] = sx
        space.restricted[t, 2] = sy
        space.restricted[t, 3] = sz

    @kernels.add
    def conjugate_gradients(
        thread: int,
        threads: int,
        sync: wp.uint64,
        give_way: wp.uint64,
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[mat33],
        copy: wp.array[wp.mat33f],
        inverse: wp.array[mat33],
        b: wp.array[vec3],
        x: wp.array[vec3],
        r: wp.array[vec3],
        p: wp.array[vec3],
        Ap: wp.array[vec3],
        partial: wp.array2d[scalar],
        tolerance: scalar,
        max_iterations: int,
        watch_curvature: int,
        outcome: wp.array[scalar],
        space: CoarseSpace,
    ):
        rows = b.shape[0]
        modes = space.residual.shape[0]
        chunks = partial.shape[0]
        all_shares = threads * shares
        taken = _take(thread, threads, sync, give_way)
        while taken >= 0:
            kind = taken // all_shares
            share = taken % all_shares
            first = (chunks * share) // all_shares
            last = (chunks * (share + 1)) // all_shares
            if kind == start:
                for t in range(first, last):
                    bb = scalar(0.0)
                    rr = scalar(0.0)
                    rz = scalar(0.0)
                    for i in range(t * chunk, wp.min((t + 1) * chunk, rows)):
                        bb += wp.dot(b[i], b[i])
                        s = b[i]
                        if copy.shape[0] > 0:
                            s -= copied_row_product(offsets, columns, copy, x, i)
                        else:
                            s -= row_product(offsets, columns, values, x, i)
                        r[i] = s
                        z = inverse[i] * s
                        Ap[i] = z
                        p[i] = vec3()
                        rr += wp.dot(s, s)
                        rz += wp.dot(s, z)
                    partial[t, 0] = bb
                    partial[t, 2] = rr
                    partial[t, 3] = rz
                    if modes > 0:
                        restrict(t, r, space)
            elif kind == coarse:
                for m in range((modes * share) // all_shares, (modes * (share + 1)) // all_shares):
                    space.solution[m] = full_row_product(space.inverse, space.residual, m)
            elif kind == direction:
                beta = outcome[6]
                for t in range(first, last):
                    if modes > 0:
                        m = 12 * (t // space.aggregate)
                        shift = vector_at(space.solution, m)
                        by_x = vector_at(space.solution, m + 3)
                        by_y = vector_at(space.solution, m + 6)
                        by_z = vector_at(space.solution, m + 9)
                        for i in range(t * chunk, wp.min((t + 1) * chunk, rows)):
                            place = space.places[i]
                            motion = shift + place[0] * by_x + place[1] * by_y + place[2] * by_z
                            p[i] = Ap[i] + wp.cw_mul(space.free[i], motion) + beta * p[i]
                    else:
                        for i in range(t * chunk, wp.min((t + 1) * chunk, rows)):
                            p[i] = Ap[i] + beta * p[i]
            elif kind == product:
                for t in range(first, last):
                    pAp = scalar(0.0)
                    pp = scalar(0.0)
                    for i in range(t * chunk, wp.min((t + 1) * chunk, rows)):
                        s = vec3()
                        if copy.shape[0] > 0:
                            s = copied_row_product(offsets, columns, copy, p, i)
                        else:
                            s = row_product(offsets, columns, values, p, i)
                        Ap[i] = s
                        pAp += wp.dot(p[i], s)
                        pp += wp.dot(p[i], p[i])
                    partial[t, 0] = pAp
                    partial[t, 1] = pp
            else:
                alpha = outcome[5]
                for t in range(first, last):
                    rr = scalar(0.0)
                    rz = scalar(0.0)
                    for i in range(t * chunk, wp.min((t + 1) * chunk, rows)):
                        x[i] = x[i] + alpha * p[i]
                        s = r[i] - alpha * Ap[i]
                        r[i] = s
                        z = inverse[i] * s
                        # the product is not needed any more
                        Ap[i] = z
                        rr += wp.dot(s, s)
                        rz += wp.dot(s, z)
                    partial[t, 2] = rr
                    partial[t, 3] = rz
                    if modes > 0:
                        restrict(t, r, space)

            if _is_last(threads, sync):
                go_on = True
                if kind == product:
                    pAp_total = total(partial, 0)
                    outcome[0] = outcome[0] + scalar(1.0)
                    outcome[3] = wp.min(outcome[3], pAp_total / total(partial, 1))
                    outcome[5] = outcome[4] / pAp_total
                elif kind == coarse:
                    rz = outcome[7]
                    for m in range(modes):
                        rz += space.residual[m] * space.solution[m]
                    outcome[6] = scalar(0.0)
                    if outcome[0] > scalar(0.0):
                        outcome[6] = rz / outcome[4]
                    outcome[4] = rz
                elif kind != direction:
                    if kind == start:
                        outcome[0] = scalar(0.0)
                        outcome[2] = tolerance * tolerance * total(partial, 0)
                        outcome[3] = scalar(wp.inf)  # type: ignore[attr-defined]
                    outcome[1] = total(partial, 2)
                    outcome[7] = total(partial, 3)
                    for m in range(modes):
                        space.residual[m] = scalar(0.0)
                    if modes > 0:
                        for t in range(chunks):
                            for d in range(4):
                                m = 12 * (t // space.aggregate) + 3 * d
                                for c in range(3):
                                    space.residual[m + c] = space.residual[m + c] + space.restricted[t, d][c]
                    # written so that a residual that is not a number ends the loop
                    go_on = outcome[1] > outcome[2] and outcome[0] < scalar(max_iterations)
                    # of a matrix that is not positive definite nothing is found, however long it goes on
                    if watch_curvature != 0 and not (outcome[3] > scalar(0.0)):
                        go_on = False
                _begin_pass(threads, sync, go_on)
            taken = _take(thread, threads, sync, give_way)

    @kernels.add
    def coarse_matrix(
        start: int,
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[wp.mat33f],
        space: CoarseSpace,
        coarse: wp.array2d[scalar],
    ):
        g = start + wp.tid()
        size = chunk * space.aggregate
        for m in range(coarse.shape[1]):
            coarse[g, m] = scalar(0.0)
        for i in range(g * size, wp.min((g + 1) * size, space.free.shape[0])):
            add_to_coarse(offsets, columns, values, size, space.free, space.places, coarse, i)

    @kernels.add
    def copy_blocks(start: int, places: wp.array[int], values: wp.array[mat33], copies: wp.array[wp.mat33f]):
        k = start + wp.tid()
        A = values[places[k]]
        copy = wp.mat33f()
        for i in range(3):
            for j in range(3):
                copy[i, j] = wp.float32(A[i, j])
        copies[k] = copy

    @kernels.add
    def multiply(
        start: int,
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[mat33],
        x: wp.array[vec3],
        z: wp.array[vec3],
    ):
        i = start + wp.tid()
        z[i] = row_product(offsets, columns, values, x, i)

    return kernels
