"""The one least-squares loop: damped steps of Gauss and Newton to the most probable point.

Rows are in standard deviations, those of the prior among them, so that half their square is `-ln p`. SciPy's
`least_squares` damps the steps; a step to where there is no point at all (no equilibrium, no such law) is shortened.
"""

import contextlib
from collections.abc import Callable

import numpy as np

from warpbrain.arrays import Floats

#: Changes, relative, of coordinates and of the sum of squares that are none.
_LEAST_STEP, _ROUNDING = 1e-7, 1e-12


class _ConvergedError(Exception):
    """The next step is shorter than the tolerance."""


def minimise(
    rows: Callable[[Floats], Floats],
    columns: Callable[[Floats], Floats],
    start: Floats,
    tolerance: float,
    *,
    bounds: tuple[Floats, Floats] | None = None,
    cannot_be: tuple[type[Exception], ...] = (),
    on_step: Callable[[float, float], None] | None = None,
    evaluations: int = 60,
) -> tuple[Floats, float]:
    """Go downhill from a point to where the next step is not worth it.

    `rows`: from coordinates (k,) to rows (n,); may raise one of `cannot_be`, but not at the start.
    `columns`: derivatives (n, k) of the rows, called at the start and after each step that was taken, at its end.
    `start` (k,): the first step goes about as far as this is long, or one unit from zero.
    `tolerance`: length of a step, in standard deviations of the posterior, that is not worth it.
    `on_step`: after each step: how long the whole one would have been, and the part of it that was taken.
    `evaluations`: at most.

    Returns `z` (k,): best coordinates; `left`: length of the next step [standard deviations]; above `tolerance` if
    nothing better lies that way.
    """
    from scipy.optimize import least_squares

    low, high = (np.full(len(start), -np.inf), np.full(len(start), np.inf)) if bounds is None else bounds
    at, last, left = start, np.zeros(0), np.inf
    J = np.zeros((0, len(start)))

    def evaluated(z: Floats) -> Floats:
        nonlocal last
        try:
            last = rows(z)
        except cannot_be:
            return np.full_like(last, np.nan)
        return last

    def differentiated(z: Floats) -> Floats:
        nonlocal at, left, J
        if len(J) and on_step is not None:
            on_step(left, float(np.linalg.norm(J @ (z - at))) / left)
        at, J = z.copy(), columns(z)
        gradient = J.T @ last
        moving = ~((z <= low) & (gradient > 0.0) | (z >= high) & (gradient < 0.0))
        left = float(np.linalg.norm(np.linalg.qr(J[:, moving])[0].T @ last))
        if left <= tolerance:
            raise _ConvergedError
        return J

    method = "dogbox" if np.isfinite([low, high]).any() else "trf"
    limits = {"ftol": _ROUNDING, "xtol": _LEAST_STEP, "gtol": None, "max_nfev": evaluations}
    with contextlib.suppress(_ConvergedError):
        least_squares(evaluated, start, differentiated, (low, high), method, **limits)
    return at, left
