"""Effects are made so large that they stand out as much as is wanted, to first order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from referee.detectability import Detectability
from referee.effects import Effect
from referee.equilibrium import Balance, NoTruth, linearised
from referee.multigrid import NotSolved
from referee.problem import Inverted, Problem
from referee.sight import Change
from referee.unknowns import answers

Floats = NDArray[np.float64]

#: An effect moves no node by more than this [m]: brains shift by 2 to 20 mm, and elements must not turn inside out.
FARTHEST = 0.015
#: A size is right if what stands out by it is so near to what is wanted; a local effect is drawn so often in one body.
_NEAR, _TRIES, _PLACES = 0.1, 4, 4
_CLOSE = 0.01


@dataclass(frozen=True)
class Wish:
    """An effect that is wanted.

    Attributes
    ----------
    draw : callable
        Draws one, of any size.
    want : callable
        Draws how much it shall stand out, below what it can; `NoTruth` if it can stand out too little.
    """

    draw: Callable[[], Effect]
    want: Callable[[float], float]


@dataclass(frozen=True, eq=False)
class Sized:
    """An effect of the right size.

    Attributes
    ----------
    effect : Effect
    change : Change
        By it, to first order.
    d, upper : float
        How much it stands out alone; see `referee.detectability`.
    wanted : float
        How much it shall.
    again : int
        How often its place or what was wanted was drawn again, since it could not be reached by a sensible size.
    """

    effect: Effect
    change: Change
    d: float
    upper: float
    wanted: float
    again: int


def sized(wish: Wish, problem: Problem, base: Balance, seen: Detectability, times: tuple[float, ...]) -> Sized:
    """Draw an effect, and find its size.

    Raises
    ------
    NoTruth
        If it stands out too little wherever it was drawn, at the largest sensible size.
    """
    again = 0
    while True:
        effect = wish.draw()
        wanted = wish.want(np.inf)
        effect, change = _sized(effect, wanted, problem, base, seen, times)
        d = seen.d(change)
        if d < (1.0 - 2.0 * _NEAR) * wanted:
            again += 1
            try:
                wanted = wish.want(d)
            except NoTruth:
                # what acts everywhere would be no larger if it were drawn again
                if effect.where is None or again >= _PLACES:
                    raise
                continue
            effect, change = _sized(effect, wanted, problem, base, seen, times)
            d = seen.d(change)
        return Sized(effect, change, d, seen.upper(change), wanted, again)


def _sized(
    effect: Effect, wanted: float, problem: Problem, base: Balance, seen: Detectability, times: tuple[float, ...]
) -> tuple[Effect, Change]:
    good: tuple[Effect, Change] | None = None
    stable = effect.limits[1]
    for _ in range(_TRIES):
        try:
            change = first_order(effect, problem, base, times)
        except NoTruth:
            # tissue that would give way: nearer to what could be solved, or to the least there is of it
            stable = float(np.sqrt(effect.size * (good[0].size if good else effect.limits[0])))
            if stable > (1.0 - _NEAR) * effect.size:
                raise
            effect = effect.resized(stable)
            continue
        good = effect, change
        most = effect.size * (FARTHEST / np.abs(change.move).max()) ** (1.0 / effect.power)
        size = effect.size * seen.factor(change, wanted) ** (1.0 / effect.power)
        fresh = effect.resized(min(size, most, stable))
        ratio = fresh.size / effect.size
        if abs(ratio - 1.0) < _NEAR or (effect.forces and effect.power == 1.0):
            return fresh, change.times(ratio**effect.power)
        effect = fresh
    if good is None:
        raise NoTruth("the tissue gives way at every size that was tried")
    return good


def first_order(effect: Effect, problem: Problem, base: Balance, times: tuple[float, ...]) -> Change:
    """What an effect changes in the first step of Newton's method from what the body does without it.

    `NoTruth` if that step cannot be solved.
    """
    acting = effect.act(problem)
    cap = problem.body.nodes("superior")
    try:
        F = acting.gradient(base.u)
        response = acting.response(F)
        tangent = base.linear if effect.forces else linearised(acting, base.u, response, base.linear)
        r = acting.residual(base.u, F, response)
        now = Balance(base.u, tangent, base.left, 1)
        change = answers(now, cap, [np.where(acting.held, r - _reaction(problem, base), r)], _CLOSE)[0]
    except (Inverted, NotSolved) as error:
        raise NoTruth(str(error) or type(error).__name__) from error
    course = effect.course(times) if times else np.ones(1)
    return Change(course[:, None, None] * change.move, course[-1] * change.force)


def spanning(effect: Effect, change: Change, problem: Problem, base: Balance, times: tuple[float, ...]) -> list[Change]:
    """Changes by all that an effect is a sum of, whatever its size and direction: of most its own change alone."""
    parts = effect.spanning
    return [change] if len(parts) == 1 else [first_order(part, problem, base, times) for part in parts]


def _reaction(problem: Problem, base: Balance) -> Floats:
    """Forces (n, 3) [N] without effects, which balance where nothing is held."""
    F = problem.gradient(base.u)
    return problem.residual(base.u, F, problem.response(F))
