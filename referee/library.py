"""Draws of each cause and what is recorded of them to first order: what the optimal analyst compares a case with."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from referee.draw import MECHANISMS, OUTSIDE, WANTED, draw_effect
from referee.effects import Asymmetry, Contact, Effect, Gravity, Inclusion, Swelling, Viscoelasticity
from referee.effects.effect import hill, plateau
from referee.equilibrium import Balance
from referee.law import respond
from referee.linear_response import LinearResponse
from referee.problem import Problem
from referee.setting import Setting
from referee.sizing import FARTHEST

Floats = NDArray[np.float64]
Random = np.random.Generator

#: Draws of a mechanism that has places, of one that has none, and of each kind outside the dictionary.
PLACES, COURSES, NAMELESS = 200, 24, 60
#: Causes whose amount is their size alone: what a draw shows is known but for so much of its logarithm.
_FIXED, _BAND = (Gravity, Asymmetry), 0.1


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of a cause.

    Attributes
    ----------
    directions : (k, rows) array
        What is recorded of each, in units of all that is not known, of length 1.
    low, high : (k,) array
        Ends between which the size of it in these units is, evenly in its logarithm.
    both : (k,) bool array
        Whether it may have the other sign as well.
    """

    directions: Floats
    low: Floats
    high: Floats
    both: NDArray[np.bool_]

    def above(self, least: float) -> Draws:
        """Those that stand out by so much or more, if any can by twice that."""
        return replace(self, low=np.maximum(self.low, min(least, 0.5 * float(self.high.max()))))

    def and_also(self, other: Draws) -> Draws:
        """These and others."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in ("directions", "low", "high", "both"))
        return Draws(*(np.concatenate(pair) for pair in pairs))


def draws_of(rows: Floats, most: Floats, fixed: bool, both: bool) -> Draws:
    """Draws from whitened rows (k, rows), the largest factor (k,) that is sensible, and how sizes may be.

    What cannot stand out by the least that is wanted is left out, unless nothing can.
    """
    lengths = np.linalg.norm(rows, axis=1)
    if fixed:
        low, high = lengths * (1.0 - _BAND), lengths * (1.0 + _BAND)
        within = (lengths >= WANTED[0]) & (lengths <= WANTED[1])
    else:
        high = np.clip(lengths * most, 1e-6, WANTED[1])
        low = np.minimum(WANTED[0], 0.5 * high)
        within = high >= WANTED[0]
    within &= lengths > 0.0
    if not within.any():
        within = lengths == lengths.max()
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    return Draws((rows / lengths[:, None])[within], low[within], high[within], np.full(within.sum(), both))


class Forces:
    """Inner forces (n, 3) [N] that come up with effects in the state without them.

    Parameters
    ----------
    problem : Problem
    base : Balance
    """

    def __init__(self, problem: Problem, base: Balance) -> None:
        self._problem, self._base = problem, base
        self._F = problem.gradient(base.u)
        response = problem.response(self._F)
        self._inner = problem.local(response.stress(problem.factor))
        self._held = problem.residual(base.u, self._F, response)
        outer = problem.body.outer
        self._normals = outer.spread(outer.vectors(problem.body.points))
        step = 1e-3
        grown = respond(problem.law, self._F, problem.mu, problem.bulk, problem.growth + step)
        self._grown = (problem.local(grown.stress(problem.factor)) - self._inner) / step

    def of(self, effect: Effect) -> Floats:
        """Of an effect at its size; of swelling and inclusion to first order in it."""
        problem = self._problem
        if isinstance(effect, Swelling):
            where = 1.0 if effect.centre is None else self._ball(effect.centre, effect.radius)
            return problem.gathered(effect.sign * effect.size * self._grown * where)
        if isinstance(effect, Inclusion):
            return problem.gathered(effect.sign * effect.size * self._inner * self._ball(effect.centre, effect.radius))
        if isinstance(effect, Contact):
            return self._let_go(effect)
        acting = effect.act(problem)
        force = -sum((load(self._base.u) for load in acting.loads[len(problem.loads) :]), np.zeros_like(self._base.u))
        if acting.stress is not None:
            return force + problem.gathered(problem.local(self._F @ acting.stress))
        if acting.law is not problem.law or acting.factor != problem.factor:
            stress = acting.response(self._F).stress(acting.factor)
            return force + problem.gathered(problem.local(stress) - self._inner)
        return force

    def _ball(self, centre: tuple[float, float, float], radius: float) -> Floats:
        return plateau(self._problem.body.centroids, centre, radius)[:, None, None]

    def _let_go(self, effect: Contact) -> Floats:
        """Of a patch of a support that gives way by a hill along the mean force with which it was held.

        The shape is an assumption: that of the answer needs a solve of its own for each patch.
        """
        body = self._problem.body
        patch = np.where(body.nodes(effect.support), hill(body.points, effect.centre, effect.size), 0.0)
        along = -(patch[:, None] * self._held).sum(axis=0)
        if not effect.lifts:
            normal = (patch[:, None] * self._normals).sum(axis=0)
            normal = normal / max(float(np.linalg.norm(normal)), 1e-30)
            along = along - (along @ normal) * normal
        along = along / max(float(np.linalg.norm(along)), 1e-30)
        # a millimetre at the middle
        move = 1e-3 * patch[:, None] * along
        return (self._base.linear.whole @ move.ravel()).reshape(move.shape)


def library(
    random: Random, setting: Setting, forces: Forces, response: LinearResponse, whiten: Callable[[Floats], Floats]
) -> tuple[dict[str, Draws], Draws]:
    """Draws of each mechanism by name, and of what is outside the dictionary together.

    Parameters
    ----------
    random : numpy Generator
    setting : Setting
    forces : Forces
    response : LinearResponse
    whiten : callable
        From rows (k, rows) to units of all that is not known.
    """
    named = {}
    for name in MECHANISMS:
        if name == "viscoelasticity" and not setting.times:
            continue
        effects = list(_effects(random, name, setting))
        named[name] = _shown(effects, setting, forces, response, whiten)
    # what pulls at a patch of the surface is a traction to first order
    outside = [kind for kind in OUTSIDE if kind != "tether"]
    many = [[draw_effect(random, kind, setting) for _ in range(NAMELESS)] for kind in outside]
    shown = [_shown(effects, setting, forces, response, whiten) for effects in many]
    nameless = shown[0]
    for more in shown[1:]:
        nameless = nameless.and_also(more)
    return named, nameless


def _effects(random: Random, name: str, setting: Setting) -> Iterator[Effect]:
    first = draw_effect(random, name, setting)
    if not isinstance(first, _FIXED) and name not in ("pressure", "viscoelasticity"):
        for _ in range(PLACES):
            effect = draw_effect(random, name, setting)
            if isinstance(effect, Contact):
                low, high = np.log(effect.limits)
                effect = effect.resized(float(np.exp(random.uniform(low, high))))
            yield effect
    elif isinstance(first, _FIXED):
        # sizes evenly in their logarithm: about evenly in that of what they show
        for size in np.geomspace(*first.limits, COURSES if name == "gravity" else COURSES // 3):
            yield draw_effect(random, name, setting).resized(float(size))
    else:
        for _ in range(COURSES if name == "viscoelasticity" else 1):
            yield draw_effect(random, name, setting)


def _shown(
    effects: list[Effect],
    setting: Setting,
    forces: Forces,
    response: LinearResponse,
    whiten: Callable[[Floats], Floats],
) -> Draws:
    first = effects[0]
    courses = None
    if isinstance(first, Viscoelasticity):
        # one force, in another course of time each
        raw = np.repeat(forces.of(first)[None], len(effects), axis=0)
        courses = np.stack([replace(e, size=first.size).course(setting.times) for e in effects])
    else:
        raw = np.stack([forces.of(effect) for effect in effects])
    rows = response.rows(raw, courses)
    points = 3 * setting.points * max(1, len(setting.times))
    farthest = np.linalg.norm(rows[:, :points].reshape(len(rows), -1, 3), axis=2).max(axis=1)
    limit = np.array([(e.limits[1] / e.size) ** e.power for e in effects])
    if isinstance(first, Contact):
        limit[:] = np.inf
    most = np.minimum(limit, FARTHEST / np.maximum(farthest, 1e-12))
    both = not isinstance(first, (*_FIXED, Contact, Viscoelasticity))
    return draws_of(whiten(rows), most, isinstance(first, _FIXED), both)
