"""One truth: what the body does with and without what its case leaves out."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from referee.creep import creep
from referee.detectability import Detectability
from referee.effects import Effect, Viscoelasticity
from referee.equilibrium import Balance, NoTruth, balance, balance_in_steps
from referee.problem import Problem
from referee.sensing import Sensors, place_sensors
from referee.setting import Setting
from referee.sight import Change, Sight
from referee.sizing import Sized, Wish, sized, spanning
from referee.unknowns import unknowns_of

Floats = NDArray[np.float64]

#: An effect that stands out less or more than so is drawn again.
LEAST, MOST = 1.0, 45.0


@dataclass(frozen=True, eq=False)
class Truth:
    """What happened.

    Attributes
    ----------
    setting : Setting
    found : tuple of Sized
        Effects at the size that they have, and how much each stands out, alone and to first order.
    given : tuple of float
        How much each stands out where the size of the other is not known.
    sensors : Sensors
    u : (times, n, 3) array
        Displacement of all nodes [m]; one time if none is told.
    declared : (n, 3) array
        Displacement without the effects [m].
    force, held : (3,) array
        With which the superior cap acts on the tissue in the end, and does without the effects [N].
    whole, upper : float
        How much all stand out together, see `referee.detectability`; 0 if nothing is missing.
    left : float
        Largest part of the forces that is not balanced.
    """

    setting: Setting
    found: tuple[Sized, ...]
    given: tuple[float, ...]
    sensors: Sensors
    u: Floats
    declared: Floats
    force: Floats
    held: Floats
    whole: float
    upper: float
    left: float

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Effects at the size that they have."""
        return tuple(one.effect for one in self.found)

    def tracked(self, nodes: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Places (k, 3) at rest [m] of nodes, and displacement (times, k, 3) [m] of the tissue that is there.

        A body that is bent has other tissue at the places that its case declares.
        """
        if self.setting.bent == 0.0:
            return self.setting.body.points[nodes], self.u[:, nodes]
        places = self.setting.outlined.points[nodes]
        members, shapes = self.setting.body.at(places)
        return places, np.einsum("ka,tkai->tki", shapes, self.u[:, members])

    def effect(self, nodes: NDArray[np.int64]) -> Floats:
        """Displacement (times, k, 3) [m] of nodes that is due to the effects."""
        return self.u[:, nodes] - self.declared[nodes]

    @property
    def effect_on_wall(self) -> Floats:
        """Displacement (p, 3) [m] of the places on the wall that is due to the effects."""
        return self.sensors.on_wall(self.u[-1] - self.declared)


def solve_truth(setting: Setting, wishes: Sequence[Wish], until: float = np.inf, steps: int = 1) -> Truth:
    """Make effects so large that they stand out as much as is wanted, and solve.

    Parameters
    ----------
    setting : Setting
    wishes : sequence of Wish
    until : float
        See `referee.equilibrium.balance`.
    steps : int
        In which the declared load is put on.

    Raises
    ------
    NoTruth
        If there is no equilibrium, the effects stand out too little or too much, or it takes too long.
    """
    problem = setting.problem()
    sensors = place_sensors(setting)
    base = balance_in_steps(problem, steps, until)
    held = cap_force_of(problem, base.u)
    if not wishes:
        u = np.repeat(base.u[None], max(1, len(setting.times)), axis=0)
        return Truth(setting, (), (), sensors, u, base.u, held, held, 0.0, 0.0, base.left)
    seen = Detectability(Sight(setting, sensors, base.u, held), unknowns_of(problem, base))
    found = [sized(wish, problem, base, seen, setting.times) for wish in wishes]
    given = conditionals(found, problem, base, seen, setting.times)
    acting, states = _settle(problem, found, setting.times, base, until)
    u = np.stack([state.u for state in states])
    force = cap_force_of(acting, u[-1])
    change = Change(u - base.u, force - held)
    whole = seen.d(change)
    if not LEAST <= whole <= MOST:
        raise NoTruth(f"the effects stand out by {whole:.2g}")
    if len(u) < len(setting.times):
        u = np.repeat(u, len(setting.times), axis=0)
    left = max(base.left, *(state.left for state in states))
    return Truth(setting, tuple(found), given, sensors, u, base.u, force, held, whole, seen.upper(change), left)


def conditionals(
    found: Sequence[Sized], problem: Problem, base: Balance, seen: Detectability, times: tuple[float, ...]
) -> tuple[float, ...]:
    """How much each effect stands out where the size of the others, and of a traction the direction, is not known."""
    if len(found) < 2:
        return tuple(one.d for one in found)
    columns = [spanning(one.effect, one.change, problem, base, times) for one in found]
    return tuple(
        seen.given(one.change, [column for k, more in enumerate(columns) if k != j for column in more])
        for j, one in enumerate(found)
    )


def _settle(
    problem: Problem, found: Sequence[Sized], times: tuple[float, ...], base: Balance, until: float
) -> tuple[Problem, list[Balance]]:
    """The problem with its effects at the end, and equilibria at each time, or one if none is told."""
    acting, branches = problem, []
    for one in found:
        if isinstance(one.effect, Viscoelasticity):
            branches = [(one.effect.size / len(one.effect.times), tau) for tau in one.effect.times]
        else:
            acting = one.effect.act(acting)
    # the first guess may turn elements inside out; what the body does without effects is a better one then, and rest
    # for tissue that becomes so stiff that it would give way there
    guesses = [base.u + sum(one.change.move[0] for one in found), base.u, np.zeros_like(base.u)]
    for k, guess in enumerate(guesses):
        try:
            near = base.linear if guess.any() else None
            if branches:
                return acting, creep(acting, branches, times, guess, near, until)
            return acting, [balance(acting, guess, near, until)]
        except NoTruth:
            if k == len(guesses) - 1 or time.process_time() > until:
                raise
    raise AssertionError


def cap_force_of(problem: Problem, u: Floats) -> Floats:
    """Force [N] with which the cap is held, or that acts on it."""
    F = problem.gradient(u)
    cap = problem.body.nodes("superior")
    return replace(problem, loads=()).residual(u, F, problem.response(F))[cap].sum(axis=0)
