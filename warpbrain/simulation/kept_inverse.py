"""The inverse of one stiffness on a GPU, kept to precondition the systems of many states near to it.

What `KeptFactors` does on the CPU. A GPU has no use for sparse factors, whose rows wait for each other; but it reads a
dense matrix of 15,000 rows in a fifth of a millisecond, and three to six products with the inverse of a factor do what
takes a captured loop hundreds of iterations. By CuPy, which is an extra, and as far as memory goes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.kernels.linear import LinearResult
from warpbrain.simulation.factored import MOST, FactoredSolver, KeptFactors


def has_cupy(device: Any) -> bool:
    """Whether a Warp device is a GPU for which CuPy is installed, and finds the libraries that it calls."""
    return bool(device.is_cuda) and _works()


@cache
def _works() -> bool:
    try:
        import cupy
        import cupyx.scipy.linalg  # noqa: F401

        cupy.linalg.cholesky(cupy.eye(2))
    except Exception:
        # whatever keeps an extra from working is no reason to stop: the same is done without it
        return False
    return True


def require_memory(device: Any, needed: int) -> None:
    """Raise `MemoryError` if a GPU has fewer bytes than these that are free, or that CuPy holds and does not use."""
    import cupy

    with cupy.cuda.Device(device.ordinal) as gpu:
        pool = cupy.get_default_memory_pool()
        free = gpu.mem_info[0] + pool.total_bytes() - pool.used_bytes()
    if needed > free:
        raise MemoryError(f"{needed / 1e9:.1f} GB of memory of {device.alias} are needed, {free / 1e9:.1f} GB are free")


@contextmanager
def stream_of(device: Any) -> Iterator[None]:
    """While it lasts, CuPy works on a GPU in the order in which Warp does."""
    import cupy
    import warp as wp

    # a stream of another GPU than the present one is refused
    with (
        cupy.cuda.Device(device.ordinal),
        cupy.cuda.ExternalStream(wp.get_stream(device).cuda_stream, device.ordinal),
    ):
        yield


#: Dense matrices in single precision for which there has to be memory.
_MATRICES = 3


class KeptInverse(KeptFactors):
    """Of the stiffness of the last state that it was renewed at, of none at first, on a GPU for which there is CuPy."""

    _worth = 60

    def __init__(self, device: Any) -> None:
        super().__init__()
        self._device = device

    def renew(self, stiffness: Any, free: NDArray[np.bool_], definite: bool) -> bool:
        """Invert a factor of a system's matrix, a `warp.sparse.BsrMatrix`; whether that serves."""
        import cupy
        import cupyx
        from cupyx.scipy.linalg import solve_triangular

        self._free, self._factors, self._wasted = None, None, 0
        size = 3 * stiffness.nrow
        with stream_of(self._device):
            try:
                require_memory(self._device, _MATRICES * 4 * size**2)
                with cupyx.errstate(linalg="raise"):
                    L = cupy.linalg.cholesky(_dense(stiffness))
            except (MemoryError, np.linalg.LinAlgError):
                return False
            self._factors = solve_triangular(L, cupy.eye(size, dtype=np.float32), lower=True, overwrite_b=True)
        self._free, self._definite = free.copy(), True
        return True

    def solve(self, forces: Any) -> Any:
        """What nodal forces (3 n,) [N] move: (3 n,) [m], arrays of CuPy."""
        import cupy

        # as a number of the order of one: forces may be too small for single precision
        scale = cupy.maximum(cupy.abs(forces).max(), np.finfo(np.float64).tiny)
        inverse = self._factors
        return scale * (inverse.T @ (inverse @ (forces / scale).astype(np.float32))).astype(np.float64)


class InvertedSolver(FactoredSolver):
    """Solves with a kept inverse, on a GPU, in double precision, without unknowns beside the displacement."""

    def prepare(self) -> None:
        self._plain.prepare()
        self._K = self._system.matrix

    def _try(self, wanted: float) -> LinearResult:
        import cupy

        system = self._system
        p, Ap = wp.empty_like(system.load), wp.empty_like(system.load)
        with stream_of(system.device):
            flat_p, flat_Ap = cupy.asarray(p).ravel(), cupy.asarray(Ap).ravel()

            def multiply(direction: Any) -> Any:
                flat_p[:] = direction
                self._plain.multiply(p, Ap)
                return flat_Ap

            residual = cupy.asarray(system.load).ravel().copy()
            x = cupy.zeros_like(residual)
            goal = wanted * float(cupy.linalg.norm(residual))
            result = _gradients(multiply, self._factors.solve, x, residual, goal, MOST)
            cupy.asarray(system.solution).ravel()[:] = x
        return result


@np.errstate(over="ignore", invalid="ignore")
def _gradients(
    multiply: Callable[[Any], Any],
    precondition: Callable[[Any], Any],
    x: Any,
    r: Any,
    goal: float,
    most: int,
) -> LinearResult:
    """Preconditioned conjugate gradients of arrays of CuPy (Hestenes and Stiefel 1952) that watch the curvature.

    They go on until the norm of the residual is at most the `goal`, and leave what they find in `x` (n,) and its
    residual in `r`. They also end where the matrix or the preconditioner is not positive definite, or what they make is
    not finite: so does a search that went too far.
    """
    p = 0.0 * r
    before, least = math.inf, math.inf
    for iteration in range(most + 1):
        # as a product, since NumPy hands a norm of CuPy's over to three kernels
        residual = math.sqrt(float(r @ r))
        if not residual > goal or iteration == most:
            break
        z = precondition(r)
        along = float(r @ z)
        if not 0.0 < along < math.inf:
            break
        p *= along / before
        p += z
        Ap = multiply(p)
        curvature = float(p @ Ap)
        least = min(least, curvature / float(p @ p))
        # written so that what is not a number ends here, too
        if not curvature > 0.0:
            break
        x += along / curvature * p
        r -= along / curvature * Ap
        before = along
    return LinearResult(iteration, residual, goal, least if math.isfinite(least) else math.nan)


def _dense(matrix: Any) -> Any:
    """A `warp.sparse.BsrMatrix` of 3 x 3 blocks as an array of CuPy, in single precision."""
    import cupy

    count = matrix.nrow
    offsets = matrix.offsets.numpy()[: count + 1]
    rows = cupy.asarray(3 * np.repeat(np.arange(count), np.diff(offsets)))
    columns = 3 * cupy.asarray(matrix.columns)[: int(offsets[-1])]
    within = cupy.arange(3)
    dense = cupy.zeros((3 * count, 3 * count), dtype=np.float32)
    at = rows[:, None, None] + within[:, None], columns[:, None, None] + within
    dense[at] = cupy.asarray(matrix.values)[: int(offsets[-1])]
    return dense


def kept_for(device: Any) -> KeptFactors | None:
    """What is kept where states are solved on a Warp device; None on a GPU for which there is no CuPy.

    On a CPU it serves terms with unknowns of their own alone.
    """
    if device.is_cpu:
        return KeptFactors()
    return KeptInverse(device) if has_cupy(device) else None
