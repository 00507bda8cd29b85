"""Conjugate gradients as one kernel that all cores of a CPU run together.

Hestenes and Stiefel's recurrences (1952), as `warp.optim.linear.CG` has them, in three passes over the rows an
iteration where Warp makes nine, and without its kernels, which take longer to compile than all others of a run. Sums
are over chunks of rows, then over chunks in order: they do not depend on the number of threads.
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import compiled_module
from warpbrain.kernels.multicore import barrier
from warpbrain.kernels.precision import Precision

#: Rows that are summed before anything is added to them.
CHUNK = 64


@cache
def gradients_kernel(precision: Precision) -> Any:
    """Make (once) the kernel of a precision; `warpbrain.kernels.multicore.launch_together` runs it.

    Its arguments after those of the team: the matrix by `offsets`, `columns` and `values`; the `inverse` diagonal
    blocks if it is `preconditioned`; `b`; `x`, the first guess and the result; `r`, `p` and `Ap`, scratch like `x`;
    `partial` (chunks, 4), scratch; the relative `tolerance`; the most iterations; whether to end where the matrix is
    seen not to be positive definite; `outcome` (4,): iterations, squares of the norm of the residual and of its goal,
    and the least `p . A p / p . p`.
    """
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"multicore_gradients_{precision.name}")
    chunk = wp.constant(CHUNK)

    @wp.func
    def total(partial: wp.array2d[scalar], column: int):
        s = scalar(0.0)
        for t in range(partial.shape[0]):
            s += partial[t, column]
        return s

    @wp.kernel(module=module)
    def conjugate_gradients(
        thread: int,
        threads: int,
        team: wp.uint64,
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[mat33],
        preconditioned: int,
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
    ):
        chunks = partial.shape[0]
        first = (chunks * thread) // threads
        last = (chunks * (thread + 1)) // threads
        rows = b.shape[0]
        for t in range(first, last):
            bb = scalar(0.0)
            rr = scalar(0.0)
            rz = scalar(0.0)
            for i in range(t * chunk, wp.min((t + 1) * chunk, rows)):
                s = b[i]
                bb += wp.dot(s, s)
                for k in range(offsets[i], offsets[i + 1]):
                    s -= values[k] * x[columns[k]]
                r[i] = s
                z = s
                if preconditioned != 0:
                    z = inverse[i] * s
                p[i] = z
                rr += wp.dot(s, s)
                rz += wp.dot(s, z)
            partial[t, 0] = bb
            partial[t, 2] = rr
            partial[t, 3] = rz
        go_on = barrier(thread, threads, team)
        goal = tolerance * tolerance * total(partial, 0)
        rr_total = total(partial, 2)
        rz_total = total(partial, 3)
        least = scalar(wp.inf)
        iterations = scalar(0.0)
        # nobody writes what others still read
        go_on = barrier(thread, threads, team) and go_on
        # written so that a residual that is not a number ends the loop
        while go_on and rr_total > goal and iterations < scalar(max_iterations):
            for t in range(first, last):
                pAp = scalar(0.0)
                pp = scalar(0.0)
                for i in range(t * chunk, wp.min((t + 1) * chunk, rows)):
                    s = vec3()
                    for k in range(offsets[i], offsets[i + 1]):
                        s += values[k] * p[columns[k]]
                    Ap[i] = s
                    pAp += wp.dot(p[i], s)
                    pp += wp.dot(p[i], p[i])
                partial[t, 0] = pAp
                partial[t, 1] = pp
            go_on = barrier(thread, threads, team)
            pAp_total = total(partial, 0)
            least = wp.min(least, pAp_total / total(partial, 1))
            iterations += scalar(1.0)
            # of a matrix that is not positive definite nothing is found, however long it goes on
            if watch_curvature != 0 and not (least > scalar(0.0)):
                go_on = False
            alpha = rz_total / pAp_total
            for t in range(first, last):
                rr = scalar(0.0)
                rz = scalar(0.0)
                for i in range(t * chunk, wp.min((t + 1) * chunk, rows)):
                    x[i] = x[i] + alpha * p[i]
                    s = r[i] - alpha * Ap[i]
                    r[i] = s
                    z = s
                    if preconditioned != 0:
                        z = inverse[i] * s
                    # the product is not needed any more
                    Ap[i] = z
                    rr += wp.dot(s, s)
                    rz += wp.dot(s, z)
                partial[t, 2] = rr
                partial[t, 3] = rz
            go_on = barrier(thread, threads, team) and go_on
            rr_total = total(partial, 2)
            rz_before = rz_total
            rz_total = total(partial, 3)
            beta = rz_total / rz_before
            for i in range(first * chunk, wp.min(last * chunk, rows)):
                p[i] = Ap[i] + beta * p[i]
            go_on = barrier(thread, threads, team) and go_on
        if thread == 0:
            outcome[0] = iterations
            outcome[1] = rr_total
            outcome[2] = goal
            outcome[3] = least

    return conjugate_gradients
