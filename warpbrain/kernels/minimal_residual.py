"""The minimal residual method: symmetric systems that are indefinite, or positive definite over scalars.

Preconditioned MINRES of Paige and Saunders (1975), as in Elman, Silvester and Wathen, Finite Elements and Fast
Iterative Solvers, 2nd ed., algorithm 4.1. All numbers of the recurrence stay on the device, and so does the test of
convergence: a solve is a graph with a loop in it, captured once, on the CPU and on CUDA.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.multicore import Graph, launch
from warpbrain.kernels.precision import Precision

#: Rows that one thread sums in the first stage of a dot product.
_CHUNK = 64
#: What the recurrence remembers, by place: norms `gamma` of the last two Lanczos vectors, `delta = z . A z`, the norm
#: of the residual with its sign, cosines and sines of the last two rotations, three numbers of the update, `|b|`.
_GAMMA_BEFORE, _GAMMA, _DELTA, _ETA, _C_BEFORE, _C, _S_BEFORE, _S, _ALPHA1, _ALPHA2, _ALPHA3, _NORM = range(12)


def node_vector(precision: Precision, scalars: int) -> Any:
    """The type of a displacement and some scalars at a node."""
    return wp.types.vector(length=3 + scalars, dtype=precision.scalar)


@cache
def _kernels(precision: Precision, unknown: Any) -> KernelSet:
    scalar = precision.scalar
    is_scalar = unknown is scalar
    kernels = KernelSet(f"minimal_residual_{1 if is_scalar else unknown._length_}_{precision.name}")
    chunk = wp.constant(_CHUNK)

    if is_scalar:

        @wp.func
        def product(x: scalar, y: scalar):
            return x * y
    else:

        @wp.func
        def product(x: unknown, y: unknown):
            return wp.dot(x, y)

    @kernels.add
    def subtract(b: wp.array[unknown], Ax: wp.array[unknown], r: wp.array[unknown]):
        i = wp.tid()
        r[i] = b[i] - Ax[i]

    @kernels.add
    def partial_dot(x: wp.array[unknown], y: wp.array[unknown], partial: wp.array[scalar]):
        t = wp.tid()
        total = scalar(0.0)
        for i in range(t * chunk, wp.min((t + 1) * chunk, x.shape[0])):
            total += product(x[i], y[i])
        partial[t] = total

    @kernels.add
    def keep_dot(partial: wp.array[scalar], place: int, state: wp.array[scalar]):
        total = scalar(0.0)
        for t in range(partial.shape[0]):
            total += partial[t]
        state[place] = total

    @kernels.add
    def start(
        tolerance: wp.array[scalar],
        state: wp.array[scalar],
        most: int,
        iterations: wp.array[int],
        go_on: wp.array[int],
    ):
        gamma = wp.sqrt(state[_GAMMA])
        state[_NORM] = wp.sqrt(state[_NORM])
        if state[_NORM] == scalar(0.0):
            # nothing is asked for: what is left of a first guess has to go
            state[_NORM] = gamma
        state[_GAMMA_BEFORE] = scalar(1.0)
        state[_GAMMA] = gamma
        state[_ETA] = gamma
        state[_C_BEFORE] = scalar(1.0)
        state[_C] = scalar(1.0)
        state[_S_BEFORE] = scalar(0.0)
        state[_S] = scalar(0.0)
        iterations[0] = 0
        go_on[0] = 0
        if gamma > tolerance[0] * state[_NORM] and most > 0:
            go_on[0] = 1

    @kernels.add
    def orthogonalise(
        Az: wp.array[unknown], state: wp.array[scalar], v_before: wp.array[unknown], v: wp.array[unknown]
    ):
        """`v` of the next Lanczos step; `A z` is of a `z` not yet divided by its norm, and so is delta."""
        i = wp.tid()
        gamma = state[_GAMMA]
        delta = state[_DELTA] / (gamma * gamma)
        now = v[i]
        v[i] = Az[i] / gamma - delta / gamma * now - gamma / state[_GAMMA_BEFORE] * v_before[i]
        v_before[i] = now

    @kernels.add
    def rotate(
        partial: wp.array[scalar],
        tolerance: wp.array[scalar],
        most: int,
        state: wp.array[scalar],
        iterations: wp.array[int],
        go_on: wp.array[int],
    ):
        """The next norm, the rotation that takes it away, and whether to go on."""
        total = scalar(0.0)
        for t in range(partial.shape[0]):
            total += partial[t]
        gamma = state[_GAMMA]
        delta = state[_DELTA] / (gamma * gamma)
        # rounding can make the square of a norm that is next to nothing negative
        following = wp.sqrt(wp.max(total, scalar(0.0)))
        alpha0 = state[_C] * delta - state[_C_BEFORE] * state[_S] * gamma
        alpha1 = wp.sqrt(alpha0 * alpha0 + following * following)
        state[_ALPHA1] = alpha1
        state[_ALPHA2] = state[_S] * delta + state[_C_BEFORE] * state[_C] * gamma
        state[_ALPHA3] = state[_S_BEFORE] * gamma
        state[_C_BEFORE] = state[_C]
        state[_S_BEFORE] = state[_S]
        state[_C] = alpha0 / alpha1
        state[_S] = following / alpha1
        state[_GAMMA_BEFORE] = gamma
        state[_GAMMA] = following
        # the update needs `c eta`, and the next step `-s eta`
        state[_DELTA] = state[_C] * state[_ETA]
        state[_ETA] = -state[_S] * state[_ETA]
        iterations[0] = iterations[0] + 1
        # written so that a residual that is not a number ends the loop
        if not (wp.abs(state[_ETA]) > tolerance[0] * state[_NORM]) or iterations[0] >= most:
            go_on[0] = 0

    @kernels.add
    def update(
        state: wp.array[scalar],
        z_next: wp.array[unknown],
        z: wp.array[unknown],
        w_before: wp.array[unknown],
        w: wp.array[unknown],
        x: wp.array[unknown],
    ):
        i = wp.tid()
        now = w[i]
        new = (z[i] / state[_GAMMA_BEFORE] - state[_ALPHA3] * w_before[i] - state[_ALPHA2] * now) / state[_ALPHA1]
        w_before[i] = now
        w[i] = new
        x[i] = x[i] + state[_DELTA] * new
        z[i] = z_next[i]

    return kernels


#: ``(x, y)``: write a linear function of `x` to `y`.
Function = Callable[[wp.array, wp.array], None]


class MinimalResidual:
    """MINRES for one symmetric operator and one symmetric positive definite preconditioner.

    An element of `b` (right-hand side) and `x` (first guess and result), both (size,), is an `unknown`: the scalar of
    the precision, or a `node_vector`. `operator` and `preconditioner` write `A x` and `M^-1 x` by launches alone.
    """

    def __init__(
        self,
        size: int,
        unknown: Any,
        precision: Precision,
        device: Any,
        *,
        operator: Function,
        preconditioner: Function,
        max_iterations: int,
    ) -> None:
        self._kernels = _kernels(precision, unknown)
        self._size, self._device = size, device
        self._operator, self._preconditioner = operator, preconditioner
        self._max_iterations = max_iterations
        arrays = (wp.zeros(size, dtype=unknown, device=device) for _ in range(9))
        self.b, self.x, self._v_before, self._v, self._z, self._z_next, self._w_before, self._w, self._Az = arrays
        chunks = (size + _CHUNK - 1) // _CHUNK
        self._partial = wp.zeros(chunks, dtype=precision.scalar, device=device)
        self._state = wp.zeros(12, dtype=precision.scalar, device=device)
        self._tolerance = wp.zeros(1, dtype=precision.scalar, device=device)
        self._iterations = wp.zeros(1, dtype=int, device=device)
        self._go_on = wp.zeros(1, dtype=int, device=device)
        self._graph: Graph | None = None

    def _launch(self, kernel: Any, dim: int, *inputs: Any) -> None:
        launch(kernel, dim, inputs, self._device)

    def _dot(self, x: wp.array, y: wp.array) -> None:
        self._launch(self._kernels.partial_dot, len(self._partial), x, y, self._partial)

    def solve(self, tolerance: float) -> None:
        """Iterate from the present `x` until the residual is `tolerance` times `b`, both in the norm of `M^-1`.

        Within the capture of a graph this only records; otherwise it replays a graph of its own.
        """
        self._tolerance.fill_(tolerance)
        if self._device.is_capturing:
            self._record()
            return
        if self._graph is None:
            self._graph = Graph(self._device)
            with self._graph.capture():
                self._record()
        self._graph.launch()

    def _record(self) -> None:
        kernels, n = self._kernels, self._size
        self._preconditioner(self.b, self._z)
        self._dot(self.b, self._z)
        self._launch(kernels.keep_dot, 1, self._partial, _NORM, self._state)
        self._operator(self.x, self._Az)
        self._launch(kernels.subtract, n, self.b, self._Az, self._v)
        self._preconditioner(self._v, self._z)
        self._dot(self._v, self._z)
        self._launch(kernels.keep_dot, 1, self._partial, _GAMMA, self._state)
        for array in (self._v_before, self._w_before, self._w):
            array.zero_()
        self._launch(
            kernels.start, 1, self._tolerance, self._state, self._max_iterations, self._iterations, self._go_on
        )
        wp.capture_while(self._go_on, self._iterate)

    def _iterate(self) -> None:
        kernels, n = self._kernels, self._size
        self._operator(self._z, self._Az)
        self._dot(self._z, self._Az)
        self._launch(kernels.keep_dot, 1, self._partial, _DELTA, self._state)
        self._launch(kernels.orthogonalise, n, self._Az, self._state, self._v_before, self._v)
        self._preconditioner(self._v, self._z_next)
        self._dot(self._v, self._z_next)
        self._launch(
            kernels.rotate, 1, self._partial, self._tolerance, self._max_iterations, self._state, self._iterations,
            self._go_on,
        )  # fmt: skip
        self._launch(kernels.update, n, self._state, self._z_next, self._z, self._w_before, self._w, self.x)

    def result(self) -> tuple[int, float, float]:
        """Iterations of the last solve, its residual and that of zero, in the norm of `M^-1` (waits for the device)."""
        state = self._state.numpy()
        return int(self._iterations.numpy()[0]), abs(float(state[_ETA])), float(state[_NORM])
