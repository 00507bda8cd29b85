"""Newton's method for a body under loads."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from referee.law import Response
from referee.multigrid import Coarse, Linear, NotSolved
from referee.problem import Inverted, Load, Problem

Floats = NDArray[np.float64]

#: Forces balance when what is left of them is smaller than this part of the forces that act.
BALANCED = 1e-5
#: A tangent is kept for the next step if the last left no larger part of the forces than this.
_KEPT = 0.1
_STEPS = 30
_HALVINGS = 6


class NoTruth(Exception):
    """No equilibrium was found."""


@dataclass(frozen=True, eq=False)
class Balance:
    """An equilibrium.

    Attributes
    ----------
    u : (n, 3) array
        Displacement [m].
    linear : Linear
        A tangent near it.
    left : float
        What is left of the forces, relative to those that act.
    steps : int
        Of Newton's method.
    """

    u: Floats
    linear: Linear
    left: float
    steps: int


def balance(
    problem: Problem, start: Floats | None = None, near: Linear | None = None, until: float = np.inf
) -> Balance:
    """Displacement at which all forces balance.

    Parameters
    ----------
    problem : Problem
    start : (n, 3) array, optional
        Where to begin [m].
    near : Linear, optional
        The tangent of a problem like this one, near where to begin.
    until : float
        When to give up, by `time.process_time` [s].

    Raises
    ------
    NoTruth
        If elements invert, the tangent is not positive, forces do not balance or it takes too long.
    """
    u = np.zeros_like(problem.body.points) if start is None else start.copy()
    missing = np.where(problem.held, problem.value - u, 0.0)
    try:
        F = problem.gradient(u)
        if np.abs(missing).max() > 0.0:
            # what is prescribed is reached by the linear answer to it, so that no element is crushed
            response = problem.response(F)
            near = linearised(problem, u, response, near)
            right = -(near.whole @ missing.ravel()).reshape(u.shape) - problem.residual(u, F, response)
            u = u + missing + near.solve(right.ravel(), 1e-2).reshape(u.shape)
            F = problem.gradient(u)
        return _newton(problem, u, F, near, until)
    except (Inverted, NotSolved, np.linalg.LinAlgError) as error:
        raise NoTruth(str(error) or type(error).__name__) from error


def balance_in_steps(problem: Problem, steps: int, until: float = np.inf) -> Balance:
    """The same from rest, with what is prescribed and what loads put on in so many equal parts."""
    start, near = None, None
    for k in range(1, steps + 1):
        loads = tuple(partial(_part, load, k / steps) for load in problem.loads)
        now = balance(replace(problem, value=k / steps * problem.value, loads=loads), start, near, until)
        start, near = now.u, now.linear
    return now


def _part(load: Load, part: float, u: Floats) -> Floats:
    return part * load(u)


def linearised(problem: Problem, u: Floats, response: Response, near: Linear | None = None) -> Linear:
    """The tangent at a displacement; one `near` lends what it was factorised for, if it holds the same."""
    matrix = problem.tangent(u, response, np.float32)
    if near is not None and (near.held == problem.held).all():
        return Linear(matrix, problem.held, near.coarse)
    return Linear(matrix, problem.held, Coarse(problem.body, matrix, problem.held))


def _newton(problem: Problem, u: Floats, F: Floats, near: Linear | None, until: float) -> Balance:
    free = ~problem.held
    response = problem.response(F)
    r = problem.residual(u, F, response)
    size = first = float(np.linalg.norm(r[free]))
    if near is None or (near.held != problem.held).any():
        near = linearised(problem, u, response)
    linear = near
    gained, acting = 0.1, 0.0
    for step in range(_STEPS):
        if time.process_time() > until:
            raise NoTruth("it takes too long")
        # a step should gain what the one before did, and less once forces nearly balance
        close = float(np.clip(0.3 * gained, 1e-3, 0.03)) if step else 0.03
        close = max(close, 0.3 * BALANCED * acting / size)
        move = -linear.solve(r.ravel(), close).reshape(u.shape)
        last = size
        for _ in range(_HALVINGS):
            try:
                F = problem.gradient(u + move)
                response = problem.response(F)
                fresh = problem.residual(u + move, F, response)
            except Inverted:
                move = 0.5 * move
                continue
            size = float(np.linalg.norm(fresh[free]))
            # a first step from rest may raise what is left: bending turns into stretch, which is stiff
            if size < (3.0 if step == 0 else 1.2) * last:
                break
            move = 0.5 * move
        else:
            raise NoTruth("no step brings forces nearer to balance")
        u, r = u + move, fresh
        # tissue that grows freely has neither reactions nor loads, but did not balance at first
        acting = max(
            float(np.linalg.norm(r[problem.held])),
            sum(float(np.linalg.norm(load(u))) for load in problem.loads),
            1e-3 * first,
        )
        if size <= BALANCED * acting:
            return Balance(u, linear, size / acting, step + 1)
        gained = size / last
        if gained > _KEPT:
            linear = Linear(problem.tangent(u, response, np.float32), problem.held, linear.coarse)
    raise NoTruth(f"forces do not balance in {_STEPS} steps: {size:.1e} N are left")
