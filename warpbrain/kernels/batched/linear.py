"""Conjugate gradients for many symmetric systems of one pattern: the batched side of `warpbrain.kernels.linear`.

Warp's own CG knows batches too (`batch_offsets`): systems one behind the other in one long vector. Its products and
updates run on all of them until the last has converged, the indices of the one mesh are stored and read once a system,
and its dot products end in atomic sums or in tiles whose shape depends on the batch. Here the sample is the fastest
index, the pattern is shared, sums have a fixed order, and a system that has converged leaves the list that the kernels
are launched over. `docs/ensembles.md` has the times of both.

A system need not end in the loop that it began in. The loop is left when few go on (`linger`); they keep their vectors
and go on in the next one beside whatever has been started until then. So a system that takes a thousand iterations
holds up nobody.

Where clusters of a GPU have room for a system, all of this is one launch, of which none is left over
(`warpbrain.kernels.batched.cluster`).
"""

from typing import Any

import numpy as np
import warp as wp

from warpbrain.kernels.batched.cluster import THREADS, Tables, cluster_kernel, on_device, sizes_of
from warpbrain.kernels.batched.layout import stages
from warpbrain.kernels.batched.parts import Parts, Pattern
from warpbrain.kernels.batched.solve_kernels import batched_solve_kernels
from warpbrain.kernels.module import Precision


class BatchedConjugateGradient:
    """Block-Jacobi CG for as many systems as there are slots; nothing is allocated in a solve.

    Solves `A (v + x) = b` for the change `x` of a given `v` (n, 3, slots) on the `free` components (n,): others have a
    row and a column of the identity in `A`, and no `b`. `x` (n, 3, slots) is first guess and result. A system ends when
    ``|b - A v - A x| <= tolerance |b - A v|``. With `parts` of the pattern clusters solve.

    `values` (pairs, 9, slots) are the stored blocks of `pattern`, laid out in memory as the solver wants them:
    `side_by_side` if the numbers of a system are, in which case those of a block of all systems are not. The residual
    may take the place of `right_hand_side` (n, 3, slots), `b`. `solving` (slots,) is 1 while a system has not ended.
    """

    def __init__(
        self,
        pattern: Pattern,
        free: wp.array,
        v: wp.array,
        x: wp.array,
        precision: Precision,
        *,
        tolerance: float,
        max_iterations: int,
        parts: Parts | None = None,
    ) -> None:
        n, _, slots = x.shape
        self._device = device = x.device
        self._size, self._slots = n, slots
        self._chunks, self._groups = stages(n)

        def zeros(*shape: int, dtype: Any = precision.scalar) -> wp.array:
            return wp.zeros(shape, dtype=dtype, device=device)

        diagonal = wp.array(pattern.diagonal, dtype=int, device=device)
        self.right_hand_side = zeros(n, 3, slots)
        self.solving = zeros(slots, dtype=int)
        self._cluster: Any = None
        self.side_by_side = parts is not None
        if parts is not None:
            self.values = zeros(slots, pattern.stored, 9).transpose((1, 2, 0))
            made, self._cluster = cluster_kernel(precision, sizes_of(parts, precision.numpy.itemsize))
            self._systems = s = made()
            s.ahead, s.parts = device.sm_count // parts.blocks, on_device(Tables, vars(parts), device)
            s.diagonal, s.pair_count, s.values = diagonal, pattern.stored, self.values
            s.b, s.v, s.free, s.x, s.max_iterations = self.right_hand_side, v, free, x, max_iterations
            s.outcome = zeros(slots, 3, dtype=wp.float64)
            self._host_outcome = wp.zeros((slots, 3), dtype=wp.float64, device="cpu", pinned=True)
            self._threads, self._tolerance = slots * parts.blocks * THREADS, wp.float64(tolerance)
            return
        self.values = zeros(pattern.stored, 9, slots)
        made, self._kernels = batched_solve_kernels(precision)
        self._systems = s = made()
        s.offsets, s.columns, s.blocks = (
            wp.array(table, dtype=int, device=device) for table in (pattern.offsets, pattern.columns, pattern.pairs)
        )
        s.diagonal, s.free, s.values, s.v, s.x, s.r = diagonal, free, self.values, v, x, self.right_hand_side
        s.z, s.p, s.q, s.inverse = zeros(n, 3, slots), zeros(n, 3, slots), zeros(n, 3, slots), zeros(n, 6, slots)
        s.shares, s.sums = zeros(3, self._chunks, slots), zeros(3, self._groups, slots)
        for name in ("alpha", "beta", "rr", "rz", "goal"):
            setattr(s, name, zeros(slots))
        s.iterations, s.solving = zeros(slots, dtype=int), self.solving
        s.tolerance, s.max_iterations = tolerance, max_iterations
        self._active, self._count, self._go_on = zeros(slots, dtype=int), zeros(1, dtype=int), zeros(1, dtype=int)

    def _launch(self, kernel: Any, dim: Any, *inputs: Any) -> None:
        # small blocks: those whose lanes have all ended make room at once
        wp.launch(kernel, dim=dim, inputs=list(inputs), device=self._device, block_dim=128)

    def start(self, slots: wp.array, count: wp.array) -> None:
        """Begin the systems of a list of slots, whose matrices, right-hand sides and guesses have been set."""
        if self._cluster is not None:
            return
        k, s, lanes = self._kernels, self._systems, self._slots
        self._launch(k.invert_diagonal, (self._size, lanes), slots, count, s)
        self._launch(k.start, (self._chunks, lanes), slots, count, s)
        self._launch(k.add_shares, (3, self._groups, lanes), slots, count, s.shares, s.sums)
        self._launch(k.finish_start, (1, lanes), slots, count, s)

    def iterate(self, slots: wp.array, count: wp.array, linger: wp.array) -> None:
        """Go on with the systems of a list of slots until no more than `linger` (of one number) have not ended.

        To be called while a graph is being captured, in which it becomes a loop on the device.
        """
        if self._cluster is not None:
            inputs = [slots, count, self._systems, self._tolerance]
            wp.launch(self._cluster, dim=self._threads, inputs=inputs, device=self._device, block_dim=THREADS)
            wp.copy(self._host_outcome, self._systems.outcome)
            return

        def look() -> None:
            self._launch(
                self._kernels.gather_active, self._slots, slots, count, self.solving, self._active, self._count
            )
            self._launch(self._kernels.go_on, 1, self._count, linger, self._go_on)

        def cycle() -> None:
            self._iteration()
            look()

        look()
        wp.capture_while(self._go_on, cycle)

    def _iteration(self) -> None:
        k, s, lanes, chunks = self._kernels, self._systems, self._slots, (self._chunks, self._slots)
        active = self._active, self._count
        self._launch(k.product, chunks, *active, s)
        self._launch(k.add_shares, (1, self._groups, lanes), *active, s.shares, s.sums)
        self._launch(k.finish_product, (1, lanes), *active, s)
        self._launch(k.advance, chunks, *active, s)
        self._launch(k.add_shares, (2, self._groups, lanes), *active, s.shares, s.sums)
        self._launch(k.finish_advance, (1, lanes), *active, s)
        self._launch(k.turn, chunks, *active, s)

    def results(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Iterations, residual norms and goals of all slots, once the device has ended."""
        if self._cluster is not None:
            iterations, residual, goal = self._host_outcome.numpy().T
            return iterations.astype(np.int32), residual.copy(), goal.copy()
        s = self._systems
        with np.errstate(invalid="ignore"):
            residual, goal = (np.sqrt(squares.numpy().astype(np.float64)) for squares in (s.rr, s.goal))
        return s.iterations.numpy().copy(), residual, goal
