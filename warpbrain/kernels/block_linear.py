"""Conjugate gradients for one matrix and several right-hand sides at once: derivatives by several parameters.

Each right-hand side has its own course, but all are in one loop: a block of the matrix is read from memory once for all
of them, and there are as many launches as for one. `ROUND` iterations are a graph; between two rounds the host looks
which have converged. Preconditioned by the inverse diagonal blocks, as the system's own solver is by default.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray
from warp.sparse import BsrMatrix

from warpbrain.kernels.linear import LinearResult, linear_kernels
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.multicore import Graph, launch
from warpbrain.kernels.precision import Precision

#: Iterations between two looks at the residuals.
ROUND = 16
#: Rows that one thread sums in the first stage of a dot product.
_CHUNK = 64


@cache
def block_kernels(precision: Precision) -> KernelSet:
    """Make (once) the kernels of a precision; arrays of vectors are (rows, right-hand sides)."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"block_linear_{precision.name}")

    @kernels.add
    def multiply(
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[mat33],
        x: wp.array2d[vec3],
        y: wp.array2d[vec3],
    ):
        i, r = wp.tid()
        s = vec3()
        for k in range(offsets[i], offsets[i + 1]):
            s += values[k] * x[columns[k], r]
        y[i, r] = s

    @kernels.add
    def partial_dots(x: wp.array2d[vec3], y: wp.array2d[vec3], z: wp.array2d[vec3], partial: wp.array3d[scalar]):
        """Of `x . y` and `x . z`."""
        t, r = wp.tid()
        first = scalar(0.0)
        second = scalar(0.0)
        for i in range(t * _CHUNK, wp.min((t + 1) * _CHUNK, x.shape[0])):
            first += wp.dot(x[i, r], y[i, r])
            second += wp.dot(x[i, r], z[i, r])
        partial[t, r, 0] = first
        partial[t, r, 1] = second

    @kernels.add
    def sum_dots(partial: wp.array3d[scalar], dots: wp.array2d[scalar]):
        r, which = wp.tid()
        total = scalar(0.0)
        for t in range(partial.shape[0]):
            total += partial[t, r, which]
        dots[r, which] = total

    @kernels.add
    def descend(
        inverse: wp.array[mat33],
        p: wp.array2d[vec3],
        Ap: wp.array2d[vec3],
        along: wp.array2d[scalar],
        residual: wp.array2d[scalar],
        goal: wp.array[scalar],
        x: wp.array2d[vec3],
        b: wp.array2d[vec3],
        z: wp.array2d[vec3],
        least: wp.array[scalar],
        iterations: wp.array[int],
    ):
        """A step along `p`; `residual[r]` holds `r . r` and `r . z`, `along[r]` `p . A p` and `p . p`."""
        i, r = wp.tid()
        # written so that a residual that is not a number goes on being none
        if residual[r, 0] <= goal[r]:
            return
        if i == 0:
            least[r] = wp.min(least[r], along[r, 0] / along[r, 1])
            iterations[r] = iterations[r] + 1
        alpha = residual[r, 1] / along[r, 0]
        x[i, r] = x[i, r] + alpha * p[i, r]
        left = b[i, r] - alpha * Ap[i, r]
        b[i, r] = left
        z[i, r] = inverse[i] * left

    @kernels.add
    def turn(z: wp.array2d[vec3], before: wp.array2d[scalar], residual: wp.array2d[scalar], p: wp.array2d[vec3]):
        i, r = wp.tid()
        beta = scalar(0.0)
        if before[r, 1] != scalar(0.0):
            beta = residual[r, 1] / before[r, 1]
        p[i, r] = z[i, r] + beta * p[i, r]

    @kernels.add
    def begin(inverse: wp.array[mat33], b: wp.array2d[vec3], z: wp.array2d[vec3], p: wp.array2d[vec3]):
        i, r = wp.tid()
        z[i, r] = inverse[i] * b[i, r]
        p[i, r] = z[i, r]

    return kernels


class BlockConjugateGradient:
    """Preconditioned CG for a symmetric matrix, whose pattern does not change, and `count` right-hand sides.

    `diagonal` (n,) says where each diagonal block is in ``matrix.values``. A right-hand side has converged when ``|b -
    A x| <= tolerance |b|``; `max_iterations` is rounded up to whole rounds.
    """

    def __init__(
        self,
        matrix: BsrMatrix,
        diagonal: wp.array,
        count: int,
        precision: Precision,
        *,
        tolerance: float,
        max_iterations: int,
    ) -> None:
        self._matrix, self._diagonal, self._precision = matrix, diagonal, precision
        self._kernels, self._device = block_kernels(precision), diagonal.device
        self._tolerance, self._max_iterations = tolerance, max_iterations
        self._shape = (diagonal.shape[0], count)
        vec3, scalar = precision.vec3, precision.scalar
        self._inverse = self._zeros(self._shape[0], dtype=precision.mat33)
        self._x, self._b, self._z, self._p, self._Ap = (self._zeros(self._shape, dtype=vec3) for _ in range(5))
        chunks = (self._shape[0] + _CHUNK - 1) // _CHUNK
        self._partial = self._zeros((chunks, count, 2), dtype=scalar)
        self._residual, self._before, self._along = (self._zeros((count, 2), dtype=scalar) for _ in range(3))
        self._goal, self._least = self._zeros(count, dtype=scalar), self._zeros(count, dtype=scalar)
        self._iterations = self._zeros(count, dtype=int)
        self._graph: Graph | None = None

    def _zeros(self, shape: Any, dtype: Any) -> wp.array:
        return wp.zeros(shape, dtype=dtype, device=self._device)

    def _launch(self, kernel: Any, dim: Any, *inputs: Any) -> None:
        launch(kernel, dim, inputs, self._device)

    def prepare(self) -> None:
        """Renew the preconditioner after the values of the matrix changed."""
        kernel = linear_kernels(self._precision).invert_diagonal
        self._launch(kernel, self._shape[0], self._diagonal, self._matrix.values, self._inverse)

    def solve(
        self, right_hand_sides: Sequence[NDArray[np.float64]], tolerance: float | None = None
    ) -> NDArray[np.float64]:
        """Solve from zero, for as many (n, 3) arrays as the solver was made for: (count, n, 3)."""
        self._b.assign(np.stack(right_hand_sides, axis=1))
        self._x.zero_()
        self._least.fill_(float("inf"))
        self._iterations.zero_()
        self._launch(self._kernels.begin, self._shape, self._inverse, self._b, self._z, self._p)
        self._dots(self._b, self._b, self._z, self._residual)
        self._goal.assign((tolerance or self._tolerance) ** 2 * self._residual.numpy()[:, 0])
        if self._graph is None:
            self._graph = Graph(self._device)
            with self._graph.capture():
                for _ in range(ROUND):
                    self._iterate()
        for _ in range(-(-self._max_iterations // ROUND)):
            # a residual that is not a number has no way on
            if not np.any(self._residual.numpy()[:, 0] > self._goal.numpy()):
                break
            self._graph.launch()
        return self._x.numpy().astype(np.float64).transpose(1, 0, 2)

    def _iterate(self) -> None:
        A, kernels = self._matrix, self._kernels
        self._launch(kernels.multiply, self._shape, A.offsets, A.columns, A.values, self._p, self._Ap)
        self._dots(self._p, self._Ap, self._p, self._along)
        self._launch(
            kernels.descend, self._shape, self._inverse, self._p, self._Ap, self._along, self._residual, self._goal,
            self._x, self._b, self._z, self._least, self._iterations,
        )  # fmt: skip
        wp.copy(self._before, self._residual)
        self._dots(self._b, self._b, self._z, self._residual)
        self._launch(kernels.turn, self._shape, self._z, self._before, self._residual, self._p)

    def _dots(self, x: wp.array, y: wp.array, z: wp.array, dots: wp.array) -> None:
        self._launch(self._kernels.partial_dots, self._partial.shape[:2], x, y, z, self._partial)
        self._launch(self._kernels.sum_dots, dots.shape, self._partial, dots)

    def results(self) -> list[LinearResult]:
        """How the last solve ended, for each right-hand side."""
        residual, goal = np.sqrt(self._residual.numpy()[:, 0]), np.sqrt(self._goal.numpy())
        each = zip(self._iterations.numpy(), residual, goal, self._least.numpy(), strict=True)
        return [LinearResult(int(n), float(r), float(g), float(least)) for n, r, g, least in each]
