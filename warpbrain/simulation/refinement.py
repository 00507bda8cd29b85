"""Solving linear systems of which only a part of the matrix is known, by what is left of the right-hand side.

A tangent is stored symmetric. Where forces have no potential (a pressure on an open surface, friction) the rest of it
is missing, and so it is where a term leaves it out on purpose. What is left of a right-hand side at a trial solution is
known exactly all the same: it is a directional difference of forces. Each solve with the stored matrix gives one more
direction, and the best combination of all of them is taken: GMRES with the stored matrix as the preconditioner, in the
form of Eisenstat, Elman and Schultz (1983, GCR), which allows inexact solves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import SolveError

#: Directions before it gives up.
_MOST = 40


def lengths(values: Floats, free: Bools) -> Floats:
    """Norm (p,) of each of p fields (p, n, 3) on the free components (n, 3)."""
    return np.asarray(np.linalg.norm(values[:, free], axis=1))


def refine(
    left_of: Callable[[int, Floats], Floats],
    correct: Callable[[Floats], Floats],
    solution: Floats,
    left: Floats,
    goals: Floats,
    free: Bools,
) -> tuple[Floats, Floats]:
    """Solve for p right-hand sides at once, from a solution and what is left there, both (p, n, 3).

    `left_of` says what is left (n, 3) of a right-hand side, by its number, at a trial solution of that shape: an affine
    function. `correct` solves with the known part of the matrix, for right-hand sides (p, n, 3). `goals` (p,) are norms
    of what may be left on the `free` components (n, 3). Returns the solution, and what is left on every component.

    Raises
    ------
    SolveError
        If the known part of the matrix is too far from the whole.
    """
    solution, left = solution.copy(), left.copy()
    tried: list[list[Floats]] = [[] for _ in goals]
    gained: list[list[Floats]] = [[] for _ in goals]
    for _ in range(_MOST):
        open_ = np.flatnonzero(lengths(left, free) > goals)
        if not len(open_):
            return solution, left
        wanted = np.zeros_like(left)
        wanted[open_] = np.where(free, left[open_], 0.0)
        steps = correct(wanted)
        for k in open_:
            now = left_of(int(k), solution[k] + steps[k])
            tried[k].append(steps[k])
            gained[k].append(left[k] - now)
            solution[k], left[k] = solution[k] + steps[k], now
            if np.linalg.norm(now[free]) > goals[k]:
                solution[k], left[k] = _best(solution[k], now, tried[k], gained[k], free)
    sizes = lengths(left, free)
    worst = int(np.argmax(sizes / goals))
    if sizes[worst] <= goals[worst]:
        return solution, left
    raise SolveError(
        f"sensitivity to parameter {worst}: out of balance by {sizes[worst]:.1e} after {_MOST} corrections, goal "
        f"{goals[worst]:.1e}: the tangent that is stored is far from the true one, or what acts is not smooth here"
    )


def _best(
    solution: Floats, left: Floats, tried: list[Floats], gained: list[Floats], free: Bools
) -> tuple[Floats, Floats]:
    """Add the combination of all directions of a right-hand side after which least is left."""
    columns = np.stack([gain[free] for gain in gained], axis=1)
    sizes = np.linalg.norm(columns, axis=0)
    sizes[sizes == 0.0] = 1.0
    shares = np.linalg.lstsq(columns / sizes, left[free], rcond=1e-12)[0] / sizes
    return (
        solution + np.tensordot(shares, np.array(tried), axes=1),
        left - np.tensordot(shares, np.array(gained), axes=1),
    )
