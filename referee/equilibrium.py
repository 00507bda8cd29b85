"""Newton's method for a body under loads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from referee.multigrid import Coarse, Linear, NotSolved
from referee.problem import Inverted, Problem

Floats = NDArray[np.float64]

#: Forces balance when what is left of them is smaller than this part of the forces that act.
BALANCED = 1e-5
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
        The tangent near it.
    left : float
        What is left of the forces, relative to those that act.
    steps : int
        Of Newton's method.
    """

    u: Floats
    linear: Linear
    left: float
    steps: int


def balance(problem: Problem, start: Floats | None = None, coarse: Coarse | None = None) -> Balance:
    """Displacement at which all forces balance.

    Parameters
    ----------
    problem : Problem
    start : (n, 3) array, optional
        Where to begin [m].
    coarse : Coarse, optional
        Of a problem like this one.

    Raises
    ------
    NoTruth
        If elements invert, the tangent is not positive or forces do not balance.
    """
    u = np.zeros_like(problem.body.points) if start is None else start.copy()
    missing = np.where(problem.held, problem.value - u, 0.0)
    try:
        F = problem.gradient(u)
        if np.abs(missing).max() > 0.0:
            # what is prescribed is reached by the linear answer to it, so that no element is crushed
            linear = linearised(problem, u, F, coarse)
            coarse = linear.coarse
            right = -(linear.whole @ missing.ravel()).reshape(u.shape) - problem.residual(u, F, problem.response(F))
            u = u + missing + linear.solve(right.ravel(), 1e-3).reshape(u.shape)
            F = problem.gradient(u)
        return _newton(problem, u, F, coarse)
    except (Inverted, NotSolved, np.linalg.LinAlgError) as error:
        raise NoTruth(str(error) or type(error).__name__) from error


def linearised(problem: Problem, u: Floats, F: Floats, coarse: Coarse | None = None) -> Linear:
    """The tangent at a displacement."""
    matrix = problem.tangent(u, problem.response(F))
    return Linear(matrix, problem.held, coarse or Coarse(problem.body, matrix, problem.held))


def _newton(problem: Problem, u: Floats, F: Floats, coarse: Coarse | None) -> Balance:
    free = ~problem.held
    response = problem.response(F)
    r = problem.residual(u, F, response)
    size = first = float(np.linalg.norm(r[free]))
    last = np.inf
    for step in range(_STEPS):
        matrix = problem.tangent(u, response)
        coarse = coarse or Coarse(problem.body, matrix, problem.held)
        linear = Linear(matrix, problem.held, coarse)
        # near the end a step should gain what Newton's method can, before it that is wasted
        close = float(np.clip(0.1 * size / last, 1e-4, 1e-2))
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
    raise NoTruth(f"forces do not balance in {_STEPS} steps: {size:.1e} N are left")
