"""Conjugate gradients on the host, for preconditioners that live there: factors, and what uses them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.kernels.linear import LinearResult


@np.errstate(over="ignore", invalid="ignore")
def host_gradients(
    multiply: Callable[[Floats], Floats],
    precondition: Callable[[Floats], Floats],
    x: Floats,
    r: Floats,
    goal: float,
    most: int,
) -> LinearResult:
    """Preconditioned conjugate gradients (Hestenes and Stiefel 1952) that watch the curvature.

    They also end where the matrix or the preconditioner is not positive definite, or what they make is not finite: so
    does a search that went too far.

    Parameters
    ----------
    multiply, precondition : callable
        What the matrix and the preconditioner make of a vector (n,).
    x, r : (n,) arrays
        A start and its residual; what is found and its residual after.
    goal : float
        Norm of the residual that is to be reached.
    most : int
        Iterations at most.
    """
    p = np.zeros_like(r)
    before, least = math.inf, math.inf
    for iteration in range(most + 1):
        # as a product, since NumPy hands a norm of CuPy's over to three kernels
        left = math.sqrt(float(r @ r))
        if not left > goal or iteration == most:
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
    return LinearResult(iteration, left, goal, least if math.isfinite(least) else math.nan)
