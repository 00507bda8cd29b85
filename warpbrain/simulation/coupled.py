"""Linear systems with unknowns of a term's own: the pressure of pore fluid beside the displacement.

To eliminate `p` from `A p = -(db/du) d` leaves a dense matrix, `K + w B^T A^-1 B` with `B = db/du`. Both together are
sparse, and symmetric:

    [      K       -sqrt(w) B^T ] [ d ]   [ r ]
    [ -sqrt(w) B        -A      ] [ p ] = [ 0 ]

but indefinite: MINRES (`warpbrain.kernels.minimal_residual`), preconditioned by the inverse diagonal blocks of `K` and
the diagonal of `A + w B diag(K)^-1 B^T`. `A` is next to nothing where fluid has no time to flow; what is left of the
second row is a force many times larger. So a solve ends only when the residual of the eliminated system is small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
import warp as wp

from warpbrain.kernels.coupled import coupled_kernels
from warpbrain.kernels.linear import ConjugateGradient, LinearResult, linear_kernels
from warpbrain.kernels.minimal_residual import MinimalResidual, four_vector
from warpbrain.kernels.multicore import launch
from warpbrain.physics.term import Coupling, Term

if TYPE_CHECKING:
    from warpbrain.simulation.system import System

#: What MINRES is asked for, relative to what is asked of the solve, in the first place; and how often it may go on.
_FIRST, _ROUNDS = 0.3, 6


class LinearSolver(Protocol):
    """What solves the system's linear systems."""

    def multiply(self, x: wp.array, z: wp.array) -> None:
        """`z = A x` of what is in the matrix."""

    def prepare(self) -> None:
        """Take notice of new values of the matrix."""

    def solve(self, tolerance: float | None = None) -> None:
        """Solve, from the present content of the solution array if that helps."""

    def result(self) -> LinearResult:
        """How the last solve ended."""


class CoupledSolver:
    """Solves the system's matrix together with what a term with unknowns of its own adds to it: one of them.

    `conjugate_gradient` is for times when these do not follow the displacement; the tolerance is relative.
    """

    def __init__(
        self,
        system: System,
        terms: Sequence[Term],
        conjugate_gradient: ConjugateGradient,
        *,
        tolerance: float,
        max_iterations: int,
    ) -> None:
        [self._term] = terms
        self._system, self._plain = system, conjugate_gradient
        self._tolerance = tolerance
        p, n, device = system.precision, system.size, system.device
        self._kernels = coupled_kernels(p)
        self._inverse = wp.zeros(n, dtype=p.mat33, device=device)
        self._diagonal = wp.zeros(n, dtype=p.scalar, device=device)
        self._product = wp.zeros(n, dtype=p.vec3, device=device)
        self._solver = MinimalResidual(
            n, four_vector(p), p, device,
            operator=self._multiply, preconditioner=self._precondition, max_iterations=max_iterations,
        )  # fmt: skip
        self._result: LinearResult | None = None

    def _launch(self, kernel: object, *inputs: object) -> None:
        launch(kernel, self._system.size, inputs, self._system.device)

    def _multiply(self, x: wp.array, y: wp.array) -> None:
        s, c = self._system, self.coupling
        self._launch(
            self._kernels.multiply, s.matrix.offsets, s.matrix.columns, s.matrix.values, c.offsets, c.columns,
            c.compliance, c.own, c.others, s.free, s.coupling_root, x, y,
        )  # fmt: skip

    def _precondition(self, x: wp.array, y: wp.array) -> None:
        self._launch(self._kernels.apply_diagonal, self._inverse, self._diagonal, x, y)

    @property
    def coupling(self) -> Coupling:
        """Of the term with unknowns of its own."""
        assert self._term.coupling is not None
        return self._term.coupling

    def multiply(self, x: wp.array, z: wp.array) -> None:
        self._plain.multiply(x, z)

    def prepare(self) -> None:
        if not self._term.coupled:
            self._plain.prepare()
            return
        s, c = self._system, self.coupling
        self._launch(linear_kernels(s.precision).invert_diagonal, s.diagonal, s.matrix.values, self._inverse)
        self._launch(
            self._kernels.invert_coupled_diagonal, c.offsets, c.columns, c.compliance, c.own, s.free, s.coupling_root,
            self._inverse, self._diagonal,
        )  # fmt: skip

    def solve(self, tolerance: float | None = None) -> None:
        """See `LinearSolver`; begins with zero, for a guess of the displacement alone is none for both."""
        self._result = None
        if not self._term.coupled:
            self._plain.solve(tolerance)
            return
        s = self._system
        wanted = self._tolerance if tolerance is None else tolerance
        self._launch(self._kernels.pack, s.load, self._solver.b)
        self._solver.x.zero_()

        def go_on(tolerance: float) -> None:
            self._solver.solve(tolerance)
            self._launch(self._kernels.unpack, self._solver.x, s.solution)

        def steps(tolerance: float, _done: int) -> int:
            go_on(tolerance)
            return self._solver.result()[0]

        if s.device.is_capturing:
            go_on(_FIRST * wanted)
        else:
            self._result = self.in_rounds(steps, wanted)

    def in_rounds(self, steps: Callable[[float, int], int], wanted: float) -> LinearResult:
        """Solve ever closer until what is left of the eliminated system is at most `wanted` times the load.

        `steps` goes on to a relative tolerance of the whole system, given the iterations that are done, and leaves what
        it finds in the solution array; it returns how many it took, 0 if it can do no more.
        """
        tighter, iterations = _FIRST, 0
        for _ in range(_ROUNDS):
            taken = steps(tighter * wanted, iterations)
            iterations += taken
            result = self.look(iterations, wanted)
            if result.converged or taken == 0 or not np.isfinite(result.residual):
                break
            tighter *= 0.3 * result.tolerance / result.residual
        return result

    def look(self, iterations: int, wanted: float) -> LinearResult:
        """The residual of the eliminated system with what is in the solution array, and the curvature along that."""
        s = self._system
        self._plain.multiply(s.solution, self._product)
        root = float(s.coupling_root.numpy()[0])
        s.add_coupling(s.solution, root * root, self._product)
        load, product = s.load.numpy().astype(np.float64), self._product.numpy().astype(np.float64)
        solution = s.solution.numpy().astype(np.float64)
        along = float(np.vdot(solution, solution))
        curvature = float(np.vdot(solution, product)) / along if along > 0.0 else float("nan")
        residual = float(np.linalg.norm(load - product))
        return LinearResult(iterations, residual, wanted * float(np.linalg.norm(load)), curvature)

    def result(self) -> LinearResult:
        if not self._term.coupled:
            return self._plain.result()
        # of a captured solve there is nothing but what it left
        return self._result or self.look(self._solver.result()[0], self._tolerance)
