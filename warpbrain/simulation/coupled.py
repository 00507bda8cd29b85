"""Linear systems with unknowns of a term's own: the pressure of pore fluid beside the displacement.

To eliminate `p` from `A p = -(db/du) d` leaves a dense matrix, `K + w B^T A^-1 B` with `B = db/du`. Both together are
sparse, and symmetric:

    [      K       -sqrt(w) B^T ] [ d ]   [ r ]
    [ -sqrt(w) B        -A      ] [ p ] = [ 0 ]

but indefinite: MINRES (`warpbrain.kernels.minimal_residual`), preconditioned by the inverse diagonal blocks of `K` and
the diagonal of `A + w B diag(K)^-1 B^T`. Of several such terms, as of two fluids in one skeleton, `p` are the unknowns
of each in turn: they meet in the displacement alone, so `A` has a block for each term. `A` is next to nothing where
fluid has no time to flow; what is left of the second row is a force many times larger. So a solve ends only when the
residual of the eliminated system is small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from warpbrain.kernels.coupled import coupled_kernels
from warpbrain.kernels.linear import ConjugateGradient, LinearResult, linear_kernels
from warpbrain.kernels.minimal_residual import MinimalResidual, node_vector
from warpbrain.kernels.multicore import launch
from warpbrain.physics.term import Coupling, Term

if TYPE_CHECKING:
    from warpbrain.simulation.system import System

#: What MINRES is asked for, relative to what is asked of the solve, in the first place; and how often it may go on.
_FIRST, _ROUNDS = 0.3, 6


class CoupledSolver:
    """Solves the system's matrix together with what terms with unknowns of their own add to it.

    `conjugate_gradient` is for times when none of these follow the displacement; the tolerance is relative.
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
        self._system, self._terms, self._plain = system, terms, conjugate_gradient
        self._tolerance, self._max_iterations = tolerance, max_iterations
        p, n, device = system.precision, system.size, system.device
        self._inverse = wp.zeros(n, dtype=p.mat33, device=device)
        self._product = wp.zeros(n, dtype=p.vec3, device=device)
        #: Of the terms whose unknowns follow the displacement, as of the last `prepare`.
        self.couplings: list[Coupling] = []
        self._result: LinearResult | None = None

    def _begin(self, couplings: list[Coupling]) -> None:
        """Make what is needed for as many unknowns at each node."""
        p, n, device, count = self._system.precision, self._system.size, self._system.device, len(couplings)
        self.couplings = couplings
        self._kernels = coupled_kernels(p, count)
        self._diagonal = wp.zeros(n, dtype=node_vector(p, count), device=device)
        self._solver = MinimalResidual(
            n, node_vector(p, count), p, device,
            operator=self._multiply, preconditioner=self._precondition, max_iterations=self._max_iterations,
        )  # fmt: skip

    def _launch(self, kernel: object, *inputs: object) -> None:
        launch(kernel, self._system.size, inputs, self._system.device)

    def _multiply(self, x: wp.array, y: wp.array) -> None:
        s, matrix = self._system, self._system.matrix
        self._launch(self._kernels.multiply, matrix.offsets, matrix.columns, matrix.values, x, y)
        for place, c in enumerate(self.couplings, 3):
            self._launch(
                self._kernels.couple, place, c.offsets, c.columns, c.compliance, c.own, c.others, s.free,
                s.coupling_root, x, y,
            )  # fmt: skip

    def _precondition(self, x: wp.array, y: wp.array) -> None:
        self._launch(self._kernels.apply_diagonal, self._inverse, self._diagonal, x, y)

    def multiply(self, x: wp.array, z: wp.array) -> None:
        self._plain.multiply(x, z)

    def prepare(self) -> None:
        couplings = [term.coupling for term in self._terms if term.coupled and term.coupling is not None]
        if not couplings:
            self.couplings = couplings
            self._plain.prepare()
            return
        if [id(coupling) for coupling in couplings] != [id(coupling) for coupling in self.couplings]:
            self._begin(couplings)
        s = self._system
        self._launch(linear_kernels(s.precision).invert_diagonal, s.diagonal, s.matrix.values, self._inverse)
        for place, c in enumerate(couplings, 3):
            self._launch(
                self._kernels.invert_coupled_diagonal, place, c.offsets, c.columns, c.compliance, c.own, s.free,
                s.coupling_root, self._inverse, self._diagonal,
            )  # fmt: skip

    def solve(self, tolerance: float | None = None) -> None:
        """See `LinearSolver`; begins with zero, for a guess of the displacement alone is none for both."""
        self._result = None
        if not self.couplings:
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
        if not self.couplings:
            return self._plain.result()
        # of a captured solve there is nothing but what it left
        return self._result or self.look(self._solver.result()[0], self._tolerance)
