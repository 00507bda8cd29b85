"""One truth: what the body does with and without what its case leaves out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from referee.creep import creep
from referee.effects import Effect, Viscoelasticity
from referee.equilibrium import Balance, NoTruth, balance, linearised
from referee.multigrid import NotSolved
from referee.problem import Inverted, Problem
from referee.sensing import Sensors, detectability, place_sensors
from referee.setting import Setting

Floats = NDArray[np.float64]

#: An effect that stands out less or more than so is drawn again.
LEAST, MOST = 1.0, 45.0
#: Relative residual to which linear answers are solved.
_CLOSE = 1e-3


@dataclass(frozen=True, eq=False)
class Truth:
    """What happened.

    Attributes
    ----------
    setting : Setting
    effects : tuple of Effect
        At the size that they have.
    sensors : Sensors
    u : (times, n, 3) array
        Displacement of all nodes [m]; one time if none is told.
    declared : (n, 3) array
        Displacement without the effects [m].
    force : (3,) array
        With which the superior cap acts on the tissue in the end [N].
    d : tuple of float
        How much each effect stands out, alone and to first order; see `referee.sensing.detectability`.
    whole : float
        How much all stand out together; 0 if nothing is missing.
    left : float
        Largest part of the forces that is not balanced.
    """

    setting: Setting
    effects: tuple[Effect, ...]
    sensors: Sensors
    u: Floats
    declared: Floats
    force: Floats
    d: tuple[float, ...]
    whole: float
    left: float

    def effect(self, nodes: NDArray[np.int64]) -> Floats:
        """Displacement (times, k, 3) [m] of nodes that is due to the effects."""
        return self.u[:, nodes] - self.declared[nodes]


def solve_truth(setting: Setting, effects: Sequence[Effect], wanted: Sequence[float]) -> Truth:
    """Make effects so large that they stand out as much as is wanted, and solve.

    Parameters
    ----------
    setting : Setting
    effects : sequence of Effect
        Of any size.
    wanted : sequence of float
        Detectability of each.

    Raises
    ------
    NoTruth
        If there is no equilibrium, or the effects stand out too little or too much whatever their size.
    """
    problem = setting.problem()
    sensors = place_sensors(setting)
    nodes = sensors.fitted
    base = balance(problem)
    stiffness = _stiffness(problem, base)[:, nodes]
    points = problem.body.points[nodes]

    def seen(move: Floats) -> float:
        # what does not change with time is seen at each of them
        often = max(1, len(setting.times)) // len(move)
        return detectability(points, np.repeat(move, often, axis=0), stiffness, setting.sigma)

    sized, moves, ds = [], [], []
    for effect, target in zip(effects, wanted, strict=True):
        for _ in range(2):
            move = _first_order(effect.act(problem), base)
            d = seen(move[None, nodes])
            fresh = effect.resized(effect.size * (target / d) ** (1.0 / effect.power))
            if effect.power == 1.0 or abs(d / target - 1.0) < 0.2:
                move, d = move * fresh.size / effect.size, d * fresh.size / effect.size
                effect = fresh
                break
            effect = fresh
        sized.append(effect)
        moves.append(move)
        ds.append(d)
    found = _settle(problem, sized, setting.times, base, moves) if sized else [base]
    u = np.stack([state.u for state in found])
    if setting.times and len(u) == 1:
        u = np.repeat(u, len(setting.times), axis=0)
    whole = seen(u[:, nodes] - base.u[nodes]) if sized else 0.0
    if sized and not LEAST <= whole <= MOST:
        raise NoTruth(f"the effects stand out by {whole:.2g}")
    force = _cap_force(problem, found[-1].u)
    left = max(base.left, *(state.left for state in found))
    return Truth(setting, tuple(sized), sensors, u, base.u, force, tuple(ds), whole, left)


def _settle(
    problem: Problem, effects: Sequence[Effect], times: Sequence[float], base: Balance, moves: Sequence[Floats]
) -> list[Balance]:
    acting, branches = problem, []
    for effect in effects:
        if isinstance(effect, Viscoelasticity):
            branches = [(effect.size / len(effect.times), tau) for tau in effect.times]
        else:
            acting = effect.act(acting)
    coarse = base.linear.coarse if (acting.held == base.linear.held).all() else None
    if branches:
        return creep(acting, branches, times, base.u, coarse)
    start = base.u + sum(moves)
    try:
        return [balance(acting, start, coarse)]
    except NoTruth:
        # the first guess may turn elements inside out
        return [balance(acting, base.u, coarse)]


def _first_order(acting: Problem, base: Balance) -> Floats:
    """First step (n, 3) of Newton's method towards a problem from what the body does without its effect."""
    try:
        F = acting.gradient(base.u)
        coarse = base.linear.coarse if (acting.held == base.linear.held).all() else None
        linear = linearised(acting, base.u, F, coarse)
        r = acting.residual(base.u, F, acting.response(F))
        return -linear.solve(r.ravel(), _CLOSE).reshape(base.u.shape)
    except (Inverted, NotSolved) as error:
        raise NoTruth(str(error) or type(error).__name__) from error


def _stiffness(problem: Problem, base: Balance) -> Floats:
    """Change (tissues, n, 3) of displacement with the logarithm of each tissue's stiffness [m]."""
    tissue = problem.body.mesh.tissue
    F = problem.gradient(base.u)
    columns = []
    for label in np.unique(tissue):
        mask = (tissue == label)[:, None]
        alone = replace(problem, mu=problem.mu * mask, bulk=problem.bulk * mask, loads=())
        inner = alone.residual(base.u, F, alone.response(F))
        columns.append(-base.linear.solve(inner.ravel(), _CLOSE).reshape(base.u.shape))
    return np.stack(columns)


def _cap_force(problem: Problem, u: Floats) -> Floats:
    F = problem.gradient(u)
    cap = problem.body.nodes("superior")
    return replace(problem, loads=()).residual(u, F, problem.response(F))[cap].sum(axis=0)
