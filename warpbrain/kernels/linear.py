"""The one door to linear algebra: preconditioned conjugate gradients on the assembled system.

A solve is one launch, on a GPU by `warpbrain.kernels.persistent`, on the CPU by
`warpbrain.kernels.multicore_gradients`, unless part of the matrix is in no block. Then it is a loop of launches, with
its test on the device, that is captured once in a graph and replayed: on CUDA one launch instead of hundreds, on the
CPU a loop in C++ instead of Python.

The preconditioner is made of the inverse diagonal blocks. Warp's sparse approximate inverse (FSAI) takes about half the
iterations and 2.3 to 3.4 times as long, none 1.1 to 1.9 times (steps and equilibria of the phantom and of 0529, one
core, 2026-11-27).
"""

import abc
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy.linalg import lapack
from warp.sparse import BsrMatrix

from warpbrain.arrays import Floats
from warpbrain.errors import SolveError
from warpbrain.kernels import persistent
from warpbrain.kernels.assembly import assembly_kernels
from warpbrain.kernels.module import KernelSet, Precision
from warpbrain.kernels.multicore import Graph, give_way, launch, launch_together, team_kernels
from warpbrain.kernels.multicore_gradients import CHUNK, coarse_space_struct, gradients_kernels, sync_words
from warpbrain.kernels.row_product import LANES, row_product_kernel
from warpbrain.threads import MOST, one_thread_of_blas


@dataclass(frozen=True)
class LinearResult:
    """How a solve by conjugate gradients ended."""

    iterations: int
    residual: float  # norm of `b - A x`, as CG updates it, unless a solve is one launch
    tolerance: float  # norm that was to be reached
    #: Smallest `p . A p / p . p` over the search directions `p`, or NaN if it was not watched. Not positive: the matrix
    #: is not positive definite.
    curvature: float

    @property
    def converged(self) -> bool:
        """The residual reached its goal (False if it is not a number)."""
        return self.residual <= self.tolerance

    @property
    def indefinite(self) -> bool:
        """The matrix is known not to be positive definite."""
        return self.curvature <= 0.0


#: Rows that one thread sums, and such sums that one thread adds up.
_ROWS, _SHARES = 16, 64


@cache
def loop_kernels(precision: Precision) -> KernelSet:
    """Make (once) the kernels of the loop of conjugate gradients (Hestenes and Stiefel 1952) in a precision.

    `numbers` (7,) are iterations, squares of the norm of the residual and of its goal, the least `p . A p / p . p`,
    `r . z`, `alpha` and `beta`. Two sums are made at a time, in stages, all in order.
    """
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"linear_{precision.name}")
    rows, shares_each = wp.constant(_ROWS), wp.constant(_SHARES)

    @kernels.add
    def dots(
        start: int,
        a: wp.array[vec3],
        b: wp.array[vec3],
        c: wp.array[vec3],
        d: wp.array[vec3],
        shares: wp.array2d[scalar],
    ):
        """Shares of `a . b` and `c . d`."""
        t = start + wp.tid()
        ab = scalar(0.0)
        cd = scalar(0.0)
        for i in range(t * rows, wp.min((t + 1) * rows, a.shape[0])):
            ab += wp.dot(a[i], b[i])
            cd += wp.dot(c[i], d[i])
        shares[t, 0] = ab
        shares[t, 1] = cd

    @kernels.add
    def add_shares(start: int, shares: wp.array2d[scalar], sums: wp.array2d[scalar]):
        g = start + wp.tid()
        for column in range(2):
            s = scalar(0.0)
            for t in range(g * shares_each, wp.min((g + 1) * shares_each, shares.shape[0])):
                s += shares[t, column]
            sums[g, column] = s

    @wp.func
    def total(sums: wp.array2d[scalar], column: int):
        s = scalar(0.0)
        for g in range(sums.shape[0]):
            s += sums[g, column]
        return s

    @kernels.add
    def begin(sums: wp.array2d[scalar], tolerance: wp.array[scalar], numbers: wp.array[scalar]):
        """Before the first of all; of `b . b`. Of `r = b`, `p = 0` and `A x` then `advance` makes the residual."""
        numbers[0] = scalar(-1.0)
        numbers[2] = tolerance[0] * tolerance[0] * total(sums, 0)
        numbers[3] = scalar(wp.inf)  # type: ignore[attr-defined]
        numbers[4] = scalar(wp.inf)  # type: ignore[attr-defined]
        numbers[5] = scalar(1.0)

    @kernels.add
    def decide(
        sums: wp.array2d[scalar], max_iterations: int, watch: int, numbers: wp.array[scalar], go_on: wp.array[int]
    ):
        """Of `r . z` and `r . r`."""
        rz = total(sums, 0)
        numbers[0] = numbers[0] + scalar(1.0)
        numbers[1] = total(sums, 1)
        numbers[6] = rz / numbers[4]
        numbers[4] = rz
        go_on[0] = 0
        # written so that a residual that is not a number ends the loop
        if numbers[1] > numbers[2] and numbers[0] < scalar(max_iterations):
            go_on[0] = 1
        # of a matrix that is not positive definite nothing is found, however long it goes on
        if watch != 0 and not (numbers[3] > scalar(0.0)):
            go_on[0] = 0

    @kernels.add
    def turn(start: int, numbers: wp.array[scalar], z: wp.array[vec3], p: wp.array[vec3]):
        i = start + wp.tid()
        p[i] = z[i] + numbers[6] * p[i]

    @kernels.add
    def measure(sums: wp.array2d[scalar], numbers: wp.array[scalar]):
        """Of `p . A p` and `p . p`."""
        pAp = total(sums, 0)
        numbers[3] = wp.min(numbers[3], pAp / total(sums, 1))
        numbers[5] = numbers[4] / pAp

    @kernels.add
    def advance(
        start: int,
        numbers: wp.array[scalar],
        p: wp.array[vec3],
        Ap: wp.array[vec3],
        inverse: wp.array[mat33],
        x: wp.array[vec3],
        r: wp.array[vec3],
        z: wp.array[vec3],
    ):
        i = start + wp.tid()
        x[i] = x[i] + numbers[5] * p[i]
        s = r[i] - numbers[5] * Ap[i]
        r[i] = s
        z[i] = inverse[i] * s

    return kernels


def solver_kernels(precision: Precision, device: wp.Device, *, only_blocks: bool = True) -> list[Any]:
    """Of each module that `conjugate_gradient` needs on a device, a kernel."""
    on_cores = [gradients_kernels(precision).multiply, team_kernels()[0]] if device.is_cpu else []
    in_loop = [] if only_blocks else [loop_kernels(precision).dots]
    return [*on_cores, assembly_kernels(precision).invert_diagonal, *in_loop]


class LinearSolver(Protocol):
    """What solves linear systems of one matrix: an operator, a preconditioner and a Krylov method.

    `warpbrain.simulation.system.System.linear_solver` chooses one, and says why.
    """

    def multiply(self, x: wp.array, z: wp.array) -> None:
        """`z = A x` of what is in the matrix."""

    def prepare(self) -> None:
        """Take notice of new values of the matrix; its pattern is kept."""

    def solve(self, tolerance: float | None = None) -> None:
        """Solve, from the present content of the solution array if that helps; the tolerance is relative."""

    def result(self) -> LinearResult:
        """How the last solve ended (waits for the device)."""


class ConjugateGradient(abc.ABC):
    """Preconditioned CG for one symmetric matrix of 3 x 3 blocks whose pattern does not change, the diagonal ones at
    the places `diagonal` (n,) in ``matrix.values``; nothing is allocated in a solve.

    `solution` (n,) of vec3 is the first guess and the result. CG ends when ``|b - A x| <= tolerance |b|``; with
    `watch_curvature` it tracks the smallest curvature of the search
    directions, to tell an indefinite matrix. ``beyond(x, factor, y)`` adds to `y` a factor times the product of `x`
    with what belongs to `A` and is in no block, whose diagonal blocks are in the matrix (and are taken off there).

    `nodes` are where the rows are [m], (n, 3), 1 for free components, 0 for constrained ones, (n,) of vec3, and what
    gives their `compact_order`, which matrices of one mesh share: on the CPU block-Jacobi has a coarse space then, if
    the matrix is not small, and `solve` cannot be captured in a graph.
    """

    def __init__(
        self,
        matrix: BsrMatrix,
        diagonal: wp.array,
        right_hand_side: wp.array,
        solution: wp.array,
        precision: Precision,
        *,
        tolerance: float,
        max_iterations: int,
        watch_curvature: bool = False,
        beyond: Callable[[wp.array, float, wp.array], None] | None = None,
        nodes: tuple[Floats, wp.array, Callable[[], Any]] | None = None,
    ) -> None:
        self._matrix, self._diagonal, self._b, self._x = matrix, diagonal, right_hand_side, solution
        self._precision, self._tolerance, self._max_iterations = precision, tolerance, max_iterations
        self._watch, self._beyond, self._nodes = watch_curvature, beyond, nodes
        self._size, self._device = len(right_hand_side), right_hand_side.device
        self._inverse = wp.empty(self._size, dtype=precision.mat33, device=self._device)
        self._solved = False
        self._begin()

    @abc.abstractmethod
    def _begin(self) -> None:
        """Make what a solve needs."""

    @abc.abstractmethod
    def _run(self, tolerance: float) -> None: ...

    @abc.abstractmethod
    def _ended(self) -> tuple[float, float, float, float]:
        """Iterations, residual, goal and least curvature of the last solve."""

    def _zeros(self, shape: Any, dtype: Any = None) -> wp.array:
        return wp.zeros(shape, dtype=dtype or self._precision.scalar, device=self._device)

    def multiply(self, x: wp.array, z: wp.array) -> None:
        """`z = A x`."""
        A = self._matrix
        inputs = [A.offsets, A.columns, A.values, x, z]
        if self._device.is_cuda:
            wp.launch(row_product_kernel(self._precision), dim=LANES * self._size, inputs=inputs, device=self._device)
        else:
            launch(gradients_kernels(self._precision).multiply, self._size, inputs, self._device)
        if self._beyond is not None:
            self._beyond(x, 1.0, z)

    def prepare(self) -> None:
        """Renew the preconditioner after the values of the matrix changed; its pattern is kept."""
        self._invert(self._diagonal, self._inverse)

    def _invert(self, diagonal: wp.array, inverse: wp.array) -> None:
        """Write the inverses of the blocks at places (n,) of the matrix."""
        inputs = [diagonal, self._matrix.values, inverse]
        launch(assembly_kernels(self._precision).invert_diagonal, self._size, inputs, self._device)

    def solve(self, tolerance: float | None = None) -> None:
        """Run CG from the present content of the solution array.

        Within the capture of a graph this only records. A tolerance other than that of the constructor is rounded down
        to a quarter of a decade.
        """
        self._solved = True
        self._run(self._tolerance if tolerance is None else 10.0 ** (math.floor(4.0 * math.log10(tolerance)) / 4.0))

    def result(self) -> LinearResult:
        """How the last solve ended (waits for the device)."""
        if not self._solved:
            raise RuntimeError("no solve has been run")
        iterations, residual, goal, curvature = self._ended()
        return LinearResult(int(iterations), residual, goal, curvature if self._watch else math.nan)


def conjugate_gradient(device: wp.Device, *, only_blocks: bool = True) -> type[ConjugateGradient]:
    """Conjugate gradients for a device: as one launch on a GPU, as one kernel on the cores of a CPU.

    Both need a matrix that is assembled into 3 x 3 blocks as a whole (`only_blocks`). Otherwise, and on GPUs on which
    blocks of threads cannot wait for each other, it is a loop of launches.
    """
    if not only_blocks:
        return LoopGradient
    return OneLaunchGradient if persistent.blocks_stay(device) else CoresGradient if device.is_cpu else LoopGradient


class OneLaunchGradient(ConjugateGradient):
    """On a GPU; see `warpbrain.kernels.persistent`."""

    def _begin(self) -> None:
        starts, lanes, messages = persistent.share_rows(self._matrix.offsets.numpy(), self._device.sm_count)
        shared_bytes = persistent.shared_memory(self._device)
        made, self._kernel = persistent.persistent_kernel(self._precision, shared_bytes, lanes, messages)
        self._blocks, n = len(starts) - 1, self._size
        self._given = s = made()
        s.offsets, s.columns, s.values = self._matrix.offsets, self._matrix.columns, self._matrix.values
        s.diagonal, s.b, s.x = self._diagonal, self._b, self._x
        s.starts = wp.array(starts, dtype=int, device=self._device)
        s.max_iterations, s.watch = self._max_iterations, int(self._watch)
        # where blocks leave what others read: two places that take turns, and one for the solution, with four numbers a
        # row; two places that take turns, with a message for each sum of a block
        s.exchange = self._zeros(12 * n, wp.float64)
        s.messages = self._zeros(4 * persistent.SUMS * self._blocks, wp.uint64)
        # what has no room on the chip
        s.scratch = self._zeros(persistent.NUMBERS * n, wp.float64)
        # the number of the last meeting, and whether one failed
        s.control = self._zeros(2, int)
        s.outcome = self._zeros(4, wp.float64)

    def prepare(self) -> None:
        """Nothing: the launch inverts the diagonal blocks itself."""

    def _run(self, tolerance: float) -> None:
        inputs = [self._given, wp.float64(tolerance)]
        threads = persistent.THREADS
        wp.launch(self._kernel, dim=self._blocks * threads, inputs=inputs, device=self._device, block_dim=threads)

    def _ended(self) -> tuple[float, float, float, float]:
        s = self._given
        if s.control.numpy()[1]:
            # the next solve may try again
            for array in (s.control, s.messages, s.exchange):
                array.zero_()
            raise SolveError(
                f"conjugate gradients on {self._device.name}: its blocks waited two seconds for each other, because "
                "something else holds a part of it; with WARPBRAIN_PERSISTENT=0 in the environment they need not wait"
            )
        return tuple(s.outcome.numpy().tolist())


#: Aggregates of the coarse space, and rows of a matrix from which on it pays: the inverse of its matrix takes as long
#: as some iterations, of which it saves more than half. Relative to the time without, an equilibrium of a cube
#: takes 1.1 to 1.2 at 216 rows, 0.8 to 0.9 at 512 and 0.6 at 1,728, of a slender bar 0.4 to 0.5 at 512
#: (`bench/coarse_space.py` twice, one core, 2026-11-28).
_AGGREGATES, _WORTH_A_COARSE_SPACE = 20, 300


def compact_order(points: Floats) -> NDArray[np.intp]:
    """Rows at points (n, 3) in an order in which those of each aggregate of a coarse space are close together."""
    size = CHUNK * _chunks_of_aggregate(len(points))
    return _bisected(np.ascontiguousarray(points.T), np.arange(len(points)), size)


def _chunks_of_aggregate(rows: int) -> int:
    return -(-rows // (CHUNK * _AGGREGATES))


def _bisected(points: Floats, rows: NDArray[np.intp], size: int) -> NDArray[np.intp]:
    """Rows in an order in which each run of so many, but for the last, is close together; ascending within it.

    `points` are where they are, (3, n).
    """
    runs = -(-len(rows) // size)
    if runs < 2:
        return np.sort(rows)
    of = points[:, rows]
    along = np.argsort(of[np.argmax(np.ptp(of, axis=1))], kind="stable")
    first, second = np.split(rows[along], [runs // 2 * size])
    return np.concatenate([_bisected(points, first, size), _bisected(points, second, size)])


#: What a solve with a copy in single precision may leave of a residual: rounding of the matrix leaves less of most. A
#: round that leaves more than the second was of no use.
_LEAST_OF_COPY, _NO_USE = 1e-4, 0.1


class CoresGradient(ConjugateGradient):
    """On the cores of a CPU; see `warpbrain.kernels.multicore_gradients`.

    With a coarse space it solves with a copy of the matrix in single precision, half as many bytes, and solves again
    for what that leaves of the residual (iterative refinement, Wilkinson 1963, Rounding Errors in Algebraic Processes,
    section 3.5). Rows of the copy are in the order of `_bisected`: compact aggregates take some 40 % less iterations
    than runs of rows of a band. Where the copy is of no use, or not positive definite, it is done without.
    """

    def _begin(self) -> None:
        size, vec3 = self._size, self._precision.vec3
        self._on_cores = gradients_kernels(self._precision)
        self._scratch = [self._zeros(size, vec3) for _ in range(3)]
        chunks = -(-size // CHUNK)
        self._partial = self._zeros((chunks, 4))
        self._sync = self._zeros(sync_words(MOST), wp.uint64)
        self._outcome = self._zeros(8)
        self._order: NDArray[np.intp] | None = None
        # values of the matrix changed since they were copied
        self._is_stale = True
        #: How a solve ended that did with the copy.
        self._refined: tuple[float, float, float, float] | None = None

    def _make_copy(self, points: Floats, free: wp.array, ordered: Callable[[], Any]) -> NDArray[np.intp]:
        """Make room for copy and coarse space; returns the order of rows."""
        A, size, vec3 = self._matrix, self._size, self._precision.vec3
        order = ordered()
        number = np.empty_like(order)
        number[order] = np.arange(size)
        offsets = A.offsets.numpy()
        lengths = np.diff(offsets)[order]
        first = np.concatenate([[0], np.cumsum(lengths)])
        away = offsets[order] - first[:-1]
        copied = np.repeat(away, lengths) + np.arange(first[-1])

        def integers(values: NDArray[np.integer]) -> wp.array:
            return wp.array(values, dtype=int, device=self._device)

        self._copied, self._columns, self._offsets = map(integers, (copied, number[A.columns.numpy()[copied]], first))
        self._copied_diagonal = integers(self._diagonal.numpy()[order])
        self._copy = self._zeros(len(copied), wp.mat33f)
        self._copied_inverse = wp.empty_like(self._inverse)
        self._left, self._correction, self._product_of = (self._zeros(size, vec3) for _ in range(3))
        chunks = self._partial.shape[0]
        self._space = space = coarse_space_struct(self._precision)()
        space.aggregate = _chunks_of_aggregate(size)
        k = self._count = -(-chunks // space.aggregate)
        space.free = wp.array(free.numpy()[order], dtype=vec3, device=self._device)
        # from the middle of its aggregate, 1 at most
        of = np.arange(size) // (CHUNK * space.aggregate)
        middles = np.stack([np.bincount(of, along) for along in points[order].T], axis=1) / np.bincount(of)[:, None]
        places = points[order] - middles[of]
        space.places = wp.array(places / np.abs(places).max(), dtype=vec3, device=self._device)
        # of two aggregates, a mode and a component of the first, a mode and a component of the other, and an empty one
        self._coarse = self._zeros((k, 192 * k))
        space.inverse, space.restricted = self._zeros((12 * k, 12 * k)), self._zeros((chunks, 4), vec3)
        space.residual, space.solution = self._zeros(12 * k), self._zeros(12 * k)
        return order

    def _renew(self) -> None:
        """Renew copy and coarse space after the values of the matrix changed; without one where it is not definite."""
        inputs = [self._copied, self._matrix.values, self._copy]
        launch(self._on_cores.copy_blocks, len(self._copied), inputs, self._device)
        self._invert(self._copied_diagonal, self._copied_inverse)
        inputs = [self._offsets, self._columns, self._copy, self._space, self._coarse]
        launch(self._on_cores.coarse_matrix, self._count, inputs, self._device, least=1)
        k = self._count
        blocks = self._coarse.numpy().astype(np.float64).reshape(k, k, 12, 4, 4)[..., :3]
        galerkin = blocks.transpose(0, 2, 1, 3, 4).reshape(12 * k, 12 * k)
        diagonal = np.diagonal(galerkin)
        # an aggregate that is held, or flat, has modes without stiffness: they are left alone
        galerkin = galerkin + np.diag(np.where(diagonal > 0.0, 1e-10 * diagonal, 1.0))
        factor, failed = lapack.dpotrf(galerkin, lower=1)
        inverse = np.zeros_like(galerkin) if failed else lapack.dpotri(factor, lower=1)[0]
        np.copyto(inverse, inverse.T, where=np.tri(12 * k, k=-1, dtype=bool).T)
        self._space.inverse.assign(inverse)

    def prepare(self) -> None:
        super().prepare()
        # who solves in another way, and only prepares, does without a copy
        self._is_stale = True

    def _run(self, tolerance: float) -> None:
        self._refined = None
        if self._nodes is not None and self._size >= _WORTH_A_COARSE_SPACE:
            with one_thread_of_blas():
                self._refined = self._refine(tolerance, *self._nodes)
        if self._refined is None:
            A = self._matrix
            rows = [A.offsets, A.columns, A.values, None, self._inverse, self._b, self._x]
            self._iterate(rows, tolerance, coarse_space_struct(self._precision)())

    def _iterate(self, rows: Sequence[wp.array | None], tolerance: float, space: Any) -> tuple[float, ...]:
        """Run the kernel; iterations, squares of residual and goal, and the least curvature."""
        self._sync.zero_()
        inputs = [
            self._sync.ptr, give_way(), *rows, *self._scratch, self._partial,
            self._precision.scalar(tolerance), self._max_iterations, int(self._watch), self._outcome, space,
        ]  # fmt: skip
        launch_together(self._on_cores.conjugate_gradients, self._size, inputs, self._device)
        return tuple(self._outcome.numpy()[:4].tolist())

    def _refine(
        self, tolerance: float, points: Floats, free: wp.array, ordered: Callable[[], Any]
    ) -> tuple[float, float, float, float] | None:
        """Solve with the copy, in rounds; how that ended as `_ended` says it, None if it was of no use."""
        order = self._order = self._make_copy(points, free, ordered) if self._order is None else self._order
        if self._is_stale:
            self._renew()
            self._is_stale = False
        rows = [
            self._offsets, self._columns, self._matrix.values, self._copy, self._copied_inverse, self._left,
            self._correction,
        ]  # fmt: skip
        # arrays of the CPU are seen by NumPy without a copy
        b, x, left, correction = (array.numpy() for array in (self._b, self._x, self._left, self._correction))

        def residual() -> Floats:
            self.multiply(self._x, self._product_of)
            difference: Floats = b - self._product_of.numpy()
            return difference

        r = residual() if x.any() else b
        goal, length = tolerance * float(np.linalg.norm(b)), float(np.linalg.norm(r))
        iterations, least = 0.0, math.inf
        is_double = self._precision.name == "double"
        while length > goal:
            left[:] = r[order]
            self._correction.zero_()
            wanted = max(_LEAST_OF_COPY, 0.9 * goal / length) if is_double else goal / length
            taken, squared, goal_squared, curvature = self._iterate(rows, wanted, self._space)
            iterations, least = iterations + taken, min(least, curvature)
            if not (squared <= goal_squared and least > 0.0):
                return None
            x[order] += correction
            if not is_double:
                # a residual of its own would be rounding
                return iterations, squared**0.5, goal, least
            r = residual()
            before, length = length, float(np.linalg.norm(r))
            if not length <= max(_NO_USE * before, goal):
                return None
        return iterations, length, goal, least

    def _ended(self) -> tuple[float, float, float, float]:
        if self._refined is not None:
            return self._refined
        iterations, residual, goal, curvature = self._outcome.numpy()[:4].tolist()
        return iterations, residual**0.5, goal**0.5, curvature


class LoopGradient(ConjugateGradient):
    """As a loop of launches, captured once in a graph and replayed."""

    def _begin(self) -> None:
        self._kernels = loop_kernels(self._precision)
        self._r, self._z, self._p, self._Ap = (self._zeros(self._size, self._precision.vec3) for _ in range(4))
        count = -(-self._size // _ROWS)
        self._shares, self._sums = self._zeros((count, 2)), self._zeros((-(-count // _SHARES), 2))
        self._numbers, self._wanted, self._go_on = self._zeros(7), self._zeros(1), self._zeros(1, int)
        self._graph: Graph | None = None

    def _run(self, tolerance: float) -> None:
        self._wanted.fill_(tolerance)
        if self._device.is_capturing:
            self._record()
            return
        if self._graph is None:
            self._graph = Graph(self._device)
            with self._graph.capture():
                self._record()
        self._graph.launch()

    def _launch(self, kernel: Any, count: int, *inputs: Any) -> None:
        launch(kernel, count, inputs, self._device)

    def _sum(self, a: wp.array, b: wp.array, c: wp.array, d: wp.array) -> None:
        """`a . b` and `c . d`."""
        launch(self._kernels.dots, len(self._shares), [a, b, c, d, self._shares], self._device, least=32)
        self._launch(self._kernels.add_shares, len(self._sums), self._shares, self._sums)

    def _record(self) -> None:
        self._sum(self._b, self._b, self._b, self._b)
        self._launch(self._kernels.begin, 1, self._sums, self._wanted, self._numbers)
        self._p.zero_()
        wp.copy(self._r, self._b)
        self.multiply(self._x, self._Ap)
        self._advance()
        wp.capture_while(self._go_on, self._iterate)

    def _iterate(self) -> None:
        self._launch(self._kernels.turn, self._size, self._numbers, self._z, self._p)
        self.multiply(self._p, self._Ap)
        self._sum(self._p, self._Ap, self._p, self._p)
        self._launch(self._kernels.measure, 1, self._sums, self._numbers)
        self._advance()

    def _advance(self) -> None:
        vectors = [self._p, self._Ap, self._inverse, self._x, self._r, self._z]
        self._launch(self._kernels.advance, self._size, self._numbers, *vectors)
        self._sum(self._r, self._z, self._r, self._r)
        watch = int(self._watch)
        self._launch(self._kernels.decide, 1, self._sums, self._max_iterations, watch, self._numbers, self._go_on)

    def _ended(self) -> tuple[float, float, float, float]:
        iterations, residual, goal, curvature = self._numbers.numpy()[:4].tolist()
        return iterations, residual**0.5, goal**0.5, curvature
