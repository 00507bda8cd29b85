"""What the choices of a batch are worth: `python bench/batch_choices.py [cpu|cuda:0] [SAMPLES]`; see docs/ensembles.md.

The linear systems of a first step of the coarse single-tissue phantom, with the laws of the first draws of its prior:
our batched CG beside Warp's own with `batch_offsets`, which gets our product and preconditioner of 3 x 3 blocks. Then
motions of 20 steps over the part of the solves that may linger when a pass ends.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp
import warp.optim.linear as warp_linear
from choices import DEVICE, milliseconds

from warpbrain.bench.batches import phantom_job
from warpbrain.ensemble.batch import Batch, pattern_of
from warpbrain.ensemble.course import step_batch
from warpbrain.kernels.assembly import assembly_kernels

SAMPLES = int(sys.argv[2]) if len(sys.argv) > 2 else (8 if DEVICE == "cpu" else 256)
TOLERANCE = 1e-6


def least(work: Callable[[], object], repeats: int = 5) -> float:
    """Least wall time of some work [ms], after a first go."""
    return milliseconds(work, repeats, min)


@wp.kernel
def multiply(
    offsets: wp.array[int], columns: wp.array[int], values: wp.array[Any], x: wp.array[Any], y: wp.array[Any],
    z: wp.array[Any], alpha: Any, beta: Any,
):  # fmt: skip
    i = wp.tid()
    s = type(x[0])()
    for k in range(offsets[i], offsets[i + 1]):
        s += values[k] * x[columns[k]]
    s = alpha * s
    if beta != type(beta)(0.0):
        s += beta * y[i]
    z[i] = s


@wp.kernel
def precondition(inverse: wp.array[Any], x: wp.array[Any], y: wp.array[Any], z: wp.array[Any], alpha: Any, beta: Any):
    i = wp.tid()
    s = alpha * (inverse[i] * x[i])
    if beta != type(beta)(0.0):
        s += beta * y[i]
    z[i] = s


class WarpBatch:
    """The systems of a batch one behind the other in one block-diagonal system, for Warp's CG."""

    def __init__(self, batch: Batch, right_hand_side: np.ndarray) -> None:
        system, b = batch.system, batch.slots
        n, nnz, p = system.size, system.matrix.nnz, system.precision
        self._real, self._size = p, n * b
        offsets, columns = system.matrix.offsets.numpy()[: n + 1], system.matrix.columns.numpy()[:nnz]
        rows = np.repeat(np.arange(n), np.diff(offsets))
        kept = batch._cg.values.numpy()[pattern_of(system).pairs].reshape(nnz, 3, 3, b)
        blocks = np.where((columns < rows)[:, None, None, None], kept.transpose(0, 2, 1, 3), kept)

        def array(values: np.ndarray, dtype: object) -> wp.array:
            return wp.array(values, dtype=dtype, device=DEVICE)

        self._offsets = array(np.r_[0, (offsets[1:] + nnz * np.arange(b)[:, None]).ravel()], int)
        self._columns = array((columns + n * np.arange(b)[:, None]).ravel(), int)
        self._values = array(blocks.transpose(3, 0, 1, 2).reshape(-1, 3, 3), p.mat33)
        diagonal = array((system.diagonal.numpy() + nnz * np.arange(b)[:, None]).ravel(), int)
        self._inverse = wp.empty(n * b, dtype=p.mat33, device=DEVICE)
        inputs = [0, diagonal, self._values, self._inverse]
        wp.launch(assembly_kernels(p).invert_diagonal, n * b, inputs=inputs, device=DEVICE)
        shape = (3 * n * b, 3 * n * b)
        systems = array(3 * n * np.arange(b + 1), int)
        operator = warp_linear.LinearOperator(shape, p.scalar, wp.get_device(DEVICE), self._product, systems, 3 * n)
        self._preconditioner = warp_linear.LinearOperator(
            shape, p.scalar, wp.get_device(DEVICE), self._precondition, systems, 3 * n
        )
        self.b = array(right_hand_side.transpose(2, 0, 1).ravel(), p.scalar)
        self.x = wp.zeros(3 * n * b, dtype=p.scalar, device=DEVICE)
        loop = {"check_every": 0, "use_cuda_graph": True} if wp.get_device(DEVICE).is_cuda else {"check_every": 1}
        self._solver = warp_linear.CG(
            operator, self.b, self.x, tol=TOLERANCE, atol=0.0, maxiter=2000, M=self._preconditioner, **loop
        )

    def _vectors(self, x: wp.array) -> wp.array:
        return wp.array(ptr=x.ptr, shape=(self._size,), dtype=self._real.vec3, device=DEVICE)

    def _product(self, x: wp.array, y: wp.array, z: wp.array, alpha: float, beta: float) -> None:
        inputs = [self._offsets, self._columns, self._values, *map(self._vectors, (x, y, z))]
        inputs += [self._real.scalar(alpha), self._real.scalar(beta)]
        wp.launch(multiply, self._size, inputs=inputs, device=DEVICE)

    def _precondition(self, x: wp.array, y: wp.array, z: wp.array, alpha: float, beta: float) -> None:
        inputs = [self._inverse, *map(self._vectors, (x, y, z)), self._real.scalar(alpha), self._real.scalar(beta)]
        wp.launch(precondition, self._size, inputs=inputs, device=DEVICE)

    def solve(self) -> None:
        """From zero."""
        self.x.zero_()
        self._solver()


def solvers() -> None:
    """Print the times of both solvers for the first step, and how far their solutions lie apart."""
    job = phantom_job(SAMPLES, "double")
    system, course = job.system(DEVICE), job.course()
    samples = sorted(job.samples, key=lambda sample: sample.stiffness)
    batch = Batch(system, samples, SAMPLES, tolerance=TOLERANCE, linger=0.0)
    course.attach(batch)
    every = np.arange(SAMPLES)
    batch.place({slot: sample.number for slot, sample in enumerate(samples)})
    course.begin(every)
    course.judge(batch.advance(every[:0], every))
    batch.advance(every, every[:0])
    solution, iterations = batch._samples.dv.numpy().copy(), batch._cg.results()[0]
    # at rest the right-hand side of the first step is h f_ext
    right = np.where(system.model.constrained, 0.0, 1e-3 * system.model.external_forces())[:, :, None]
    right = np.repeat(right, SAMPLES, axis=2)
    lists = batch._start
    # the step began at rest
    batch._samples.v.zero_()

    def ours() -> None:
        batch._samples.dv.zero_()
        batch._cg.right_hand_side.assign(right)
        batch._cg.start(*lists)
        batch._cg.iterate(*lists, batch._linger_count)

    with wp.ScopedCapture(device=DEVICE) as capture:
        batch._samples.dv.zero_()
        batch._cg.start(*lists)
        batch._cg.iterate(*lists, batch._linger_count)

    def replay() -> None:
        batch._cg.right_hand_side.assign(right)
        wp.capture_launch(capture.graph)

    def copy_only() -> None:
        batch._cg.right_hand_side.assign(right)

    ours()
    own = least(replay) - least(copy_only)
    other = WarpBatch(batch, right)
    theirs = least(other.solve)
    apart = np.abs(other.x.numpy().reshape(SAMPLES, -1, 3).transpose(1, 2, 0) - solution).max() / np.abs(solution).max()
    print(f"{SAMPLES} systems, {iterations.min()} to {iterations.max()} iterations, solutions {apart:.1e} apart")
    print(
        f"  ours                       {own:>9.3f} ms, {1000 * own / iterations.sum():.2f} us an iteration and system"
    )
    print(f"  Warp's with batch_offsets  {theirs:>9.3f} ms, {theirs / own:.2f} times as long")


def lingering() -> None:
    """Print the time of a step and sample over the part of the solves that may linger."""
    job = phantom_job(SAMPLES, "double")
    system = job.system(DEVICE)
    samples = sorted(job.samples, key=lambda sample: sample.stiffness)
    for order in ("by stiffness", "by number"):
        numbers = [sample.number for sample in samples]
        if order == "by number":
            numbers.sort()
        for linger in (0.0, 0.125, 0.25, 0.5):
            course = job.course()
            batch = Batch(system, samples, SAMPLES, tolerance=TOLERANCE, linger=linger)

            def run(batch: Batch = batch, course: object = course, numbers: list[int] = numbers) -> None:
                for _ in step_batch(batch, course, numbers):
                    pass

            each = least(run, 3) / (SAMPLES * job.steps)
            print(f"  samples {order}, {100 * linger:>4.1f} % may linger: {each:.4f} ms a step and sample")


if __name__ == "__main__":
    wp.config.log_level = wp.LOG_WARNING
    print(wp.get_device(DEVICE).name)
    solvers()
    lingering()
