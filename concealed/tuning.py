"""Find the strength of the main effect and the level of the fluid that move both walls as far as wanted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import SolveError

Floats = NDArray[np.float64]
#: From (strength, level [m]) to the root mean square motion of ventricles and cavity [m].
Evaluate = Callable[[float, float], tuple[float, float]]

#: Shares of the largest strength that are tried first, and the level [m] they are tried at.
FIRST = (0.08, 0.2, 0.4, 0.7, 1.0)
#: Motion is taken to grow no faster than this power of strength: what stays behind that is not tried further.
FASTEST = 1.4
FIRST_LEVEL = 0.135
#: Without any drainage the ventricles may move by so much more than wanted for the search to be worth it.
HOPEFUL = 1.1
#: Levels lie between these [m]: deeply drained, and not drained at all.
LEVELS = (0.09, 0.19)
#: Unit of level beside the logarithm of strength [m], and longest step in each.
LEVEL_UNIT = 0.01
LONGEST = np.array([0.6, 1.5])


class Unreachable(Exception):
    """The wanted motion is not reached at a plausible strength."""


@dataclass(frozen=True)
class Tuned:
    """Where the search ended.

    Attributes
    ----------
    strength : float
        Of the main effect, without its sign.
    level : float
        Of the fluid [m].
    slopes : (2, 2) array
        How the logarithms of both motions change with the logarithm of strength and with level, to start from again.
    miss : float
        Largest relative difference from what was wanted.
    """

    strength: float
    level: float
    slopes: Floats
    miss: float


def first_guess(evaluate: Evaluate, limit: float, wanted: tuple[float, float]) -> float:
    """Strength at which the cavity moves about as wanted, from a few trials.

    Raises
    ------
    Unreachable
        If there is none, or the ventricles then move too far even if no fluid has drained.
    """
    strength = _reaching(evaluate, limit, wanted[1])
    try:
        least = evaluate(strength, LEVELS[1])[0]
    except SolveError as error:
        raise Unreachable from error
    if least > HOPEFUL * wanted[0]:
        raise Unreachable
    return strength


def _reaching(evaluate: Evaluate, limit: float, wanted: float) -> float:
    below: tuple[float, float] | None = None
    for share in FIRST:
        try:
            moved = evaluate(share * limit, FIRST_LEVEL)[1]
        except SolveError as error:
            raise Unreachable from error
        if moved >= wanted:
            if below is None:
                return share * limit
            strengths, motions = np.log([[below[0], share * limit], [below[1], moved]])
            return float(np.exp(np.interp(np.log(wanted), motions, strengths)))
        if moved * share**-FASTEST < wanted:
            break
        below = share * limit, moved
    raise Unreachable


def tune(
    evaluate: Evaluate,
    limit: float,
    wanted: tuple[float, float],
    strength: float,
    level: float = FIRST_LEVEL,
    slopes: Floats | None = None,
    close: float = 0.01,
    rounds: int = 9,
) -> Tuned:
    """Solve for strength and level by Broyden's method on logarithms.

    Parameters
    ----------
    evaluate : callable
    limit : float
        Largest plausible strength.
    wanted : (float, float)
        Motion of ventricles and cavity [m].
    strength, level : float
        Where to start.
    slopes : (2, 2) array, optional
        From a search before; by default found by differences.
    close : float
        Relative difference to stop at.
    rounds : int
        Steps at most.

    Raises
    ------
    Unreachable
        If a start or a step has no equilibrium.
    """

    def off(x: Floats) -> Floats:
        return np.log(np.array(evaluate(float(np.exp(x[0])), float(LEVEL_UNIT * x[1])))) - np.log(wanted)

    lower = np.array([np.log(1e-3 * limit), LEVELS[0] / LEVEL_UNIT])
    upper = np.array([np.log(limit), LEVELS[1] / LEVEL_UNIT])
    try:
        x = np.clip([np.log(strength), level / LEVEL_UNIT], lower, upper)
        r = off(x)
        if slopes is None:
            steps = np.array([-0.15, -0.5])
            slopes = np.stack([(off(x + step) - r) / step.sum() for step in np.diag(steps)], axis=1)
        best = (x, r)
        for _ in range(rounds):
            if np.abs(best[1]).max() < close:
                break
            # a level that is out of the fluid has no slope: the least step that serves
            step = np.clip(-np.linalg.pinv(slopes, rcond=1e-2) @ r, -LONGEST, LONGEST)
            step = np.clip(x + step, lower, upper) - x
            if np.abs(step).max() < 1e-4:
                break
            fresh = off(x + step)
            slopes = slopes + np.outer(fresh - r - slopes @ step, step) / (step @ step)
            x, r = x + step, fresh
            if np.abs(r).max() < np.abs(best[1]).max():
                best = (x, r)
    except SolveError as error:
        raise Unreachable from error
    x, r = best
    return Tuned(float(np.exp(x[0])), float(LEVEL_UNIT * x[1]), slopes, float(np.expm1(np.abs(r).max())))
