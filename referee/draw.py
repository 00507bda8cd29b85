"""Effects drawn at random: where they are and what they are like, not yet how large."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from referee.body import Body
from referee.effects import (
    Asymmetry,
    Attraction,
    Contact,
    Effect,
    Gravity,
    Inclusion,
    Pressure,
    PreStress,
    Stripes,
    Swelling,
    Swirl,
    Tether,
    Traction,
    UniformForce,
    Viscoelasticity,
    Wire,
)
from referee.effects.effect import Place, unit
from referee.equilibrium import NoTruth
from referee.setting import DOWN, Setting, triple

Floats = NDArray[np.float64]
Random = np.random.Generator

#: Sizes are drawn such that effects stand out by between these, evenly in their logarithm.
WANTED = (2.5, 32.0)
#: Largest angle [rad] between where gravity points and where the case says.
_TILTED = np.deg2rad(8.0)
#: Least angle [rad] between a uniform force outside the dictionary and the line of gravity.
_ASIDE = np.deg2rad(40.0)
#: Least and largest rigid motion of the trap `registration`: shift [m] and turn [rad].
RIGID_SHIFT, RIGID_TURN = (0.003, 0.008), (float(np.deg2rad(2.0)), float(np.deg2rad(8.0)))
#: Of the traps `noise` and `stiffness`: factor on all noise, spread of the logarithm of stiffness.
NOISY, UNEVEN = 3.0, 0.6
#: How far a local effect is from what is held [m].
_AWAY = 0.03


def wanted(random: Random, most: float, least: float = WANTED[0]) -> float:
    """How much an effect shall stand out, if it can by `most`; `NoTruth` if that is too little."""
    most = min(most, WANTED[1])
    if most < least:
        raise NoTruth(f"an effect can stand out by {most:.2g} only")
    return float(np.exp(random.uniform(np.log(least), np.log(most))))


def draw_effect(random: Random, kind: str, setting: Setting) -> Effect:
    """An effect of a kind, at a middling size."""
    return _KINDS[kind](random, setting)


def _gravity(random: Random, setting: Setting) -> Effect:
    down = np.array(DOWN)
    side = unit(np.cross(down, random.normal(size=3)))
    angle = random.uniform(0.0, _TILTED)
    points = setting.body.points
    return Gravity(
        size=0.03,
        direction=triple(np.cos(angle) * down + np.sin(angle) * side),
        declared=DOWN,
        height=float(np.ptp(points @ down)),
    )


def _pressure(random: Random, setting: Setting) -> Effect:
    return Pressure(size=60.0, sign=_sign(random))


def _traction(random: Random, setting: Setting) -> Effect:
    centre, normal = _surface(random, setting.body)
    aslant = unit(-normal + 0.6 * unit(random.normal(size=3)))
    pushes = 1.0 if random.random() < 0.7 else -1.0
    radius = float(random.uniform(0.009, 0.016))
    return Traction(size=500.0, centre=centre, radius=radius, direction=triple(pushes * aslant))


def _contact(random: Random, setting: Setting) -> Effect:
    body = setting.body
    support = "side" if random.random() < 0.5 else "fixed"
    nodes = np.flatnonzero(body.nodes(support))
    centre = triple(body.points[random.choice(nodes)])
    return Contact(size=0.03, centre=centre, lifts=bool(random.random() < 0.5), support=support)


def _swelling(random: Random, setting: Setting) -> Effect:
    centre = _inside(random, setting.body) if random.random() < 0.5 else None
    return Swelling(size=0.03, sign=_sign(random), centre=centre, radius=float(random.uniform(0.012, 0.022)))


def _inclusion(random: Random, setting: Setting) -> Effect:
    # below the cap, where the declared load strains the tissue
    body = setting.body
    cap = body.points[body.nodes("superior")].mean(axis=0)
    near = body.centroids[np.linalg.norm(body.centroids - cap, axis=1) < 0.05]
    centre = triple(near[random.integers(len(near))])
    return Inclusion(size=0.6, sign=_sign(random), centre=centre, radius=float(random.uniform(0.018, 0.028)))


def _asymmetry(random: Random, setting: Setting) -> Effect:
    return Asymmetry(size=float(random.uniform(8.0, 26.0)))


def _viscoelasticity(random: Random, setting: Setting) -> Effect:
    first = setting.times[0] * np.exp(random.uniform(0.0, np.log(8.0)))
    return Viscoelasticity(size=0.5, times=(float(first), float(5.0 * first)))


def _tether(random: Random, setting: Setting) -> Effect:
    centre, normal = _surface(random, setting.body)
    anchor = np.asarray(centre) + 0.03 * unit(normal + 0.8 * unit(random.normal(size=3)))
    return Tether(size=0.1, centre=centre, radius=float(random.uniform(0.008, 0.014)), anchor=triple(anchor))


def _pre_stress(random: Random, setting: Setting) -> Effect:
    normal = unit(random.normal(size=3))
    axis = unit(np.cross(normal, random.normal(size=3)))
    thickness = float(random.uniform(0.015, 0.03))
    return PreStress(
        size=100.0,
        centre=_inside(random, setting.body),
        normal=triple(normal),
        thickness=thickness,
        axis=triple(axis),
    )


def _wire(random: Random, setting: Setting) -> Effect:
    here, there = _apart(lambda: _surface(random, setting.body)[0], 0.05)
    return Wire(size=0.1, centre=here, other=there, radius=float(random.uniform(0.008, 0.014)))


def _uniform_force(random: Random, setting: Setting) -> Effect:
    direction = unit(random.normal(size=3))
    while abs(direction @ np.array(DOWN)) > np.cos(_ASIDE):
        direction = unit(random.normal(size=3))
    return UniformForce(size=200.0, direction=triple(direction))


def _swirl(random: Random, setting: Setting) -> Effect:
    axis = triple(unit(random.normal(size=3)))
    length = float(random.uniform(0.02, 0.04))
    return Swirl(size=500.0, centre=_inside(random, setting.body), axis=axis, length=length)


def _attraction(random: Random, setting: Setting) -> Effect:
    here, there = _apart(lambda: _inside(random, setting.body), 0.03)
    return Attraction(size=0.1, centre=here, other=there, radius=float(random.uniform(0.01, 0.016)))


def _stripes(random: Random, setting: Setting) -> Effect:
    return Stripes(
        size=100.0,
        direction=triple(unit(random.normal(size=3))),
        wavelength=float(random.uniform(0.025, 0.05)),
        phase=float(random.uniform(0.0, 2.0 * np.pi)),
    )


_KINDS: dict[str, Callable[[Random, Setting], Effect]] = {
    "gravity": _gravity,
    "pressure": _pressure,
    "traction": _traction,
    "contact": _contact,
    "swelling": _swelling,
    "inclusion": _inclusion,
    "asymmetry": _asymmetry,
    "viscoelasticity": _viscoelasticity,
    "tether": _tether,
    "pre-stress": _pre_stress,
    "wire": _wire,
    "uniform-force": _uniform_force,
    "swirl": _swirl,
    "attraction": _attraction,
    "stripes": _stripes,
}
#: Names of the tool's mechanisms that truths may have.
MECHANISMS = tuple(_KINDS)[:8]
#: Effects that the tool has no name for.
OUTSIDE = tuple(_KINDS)[8:]


def _trap_registration(random: Random, setting: Setting) -> Setting:
    # an exact rigid motion: the turn is finite
    shift = random.uniform(*RIGID_SHIFT) * unit(random.normal(size=3))
    turn = random.uniform(*RIGID_TURN) * unit(random.normal(size=3))
    return replace(setting, shift=triple(shift), turn=triple(turn))


_TRAPS: dict[str, Callable[[Random, Setting], Setting]] = {
    "registration": _trap_registration,
    "mispaired": lambda random, setting: replace(setting, mispaired=0.12),
    "noise": lambda random, setting: replace(setting, noise=NOISY, declares_sigma=True),
    "stiffness": lambda random, setting: replace(setting, field_sd=UNEVEN, field_length=0.02),
    "coarse": lambda random, setting: replace(setting, mesh="phantom-coarse"),
    "segmentation": lambda random, setting: replace(setting, bent=float(random.uniform(0.001, 0.002))),
}
#: Cases in which something is wrong that is no physics.
TRAPS = tuple(_TRAPS)


def trapped(random: Random, trap: str, setting: Setting) -> Setting:
    """The setting with something wrong that is no physics."""
    return _TRAPS[trap](random, setting)


def _sign(random: Random) -> int:
    return 1 if random.random() < 0.5 else -1


def _free(body: Body, points: Floats) -> NDArray[np.bool_]:
    """Which points are away from what is held."""
    held = body.points[body.nodes("fixed") | body.nodes("side")]
    return np.asarray(cKDTree(held).query(points)[0] > _AWAY)


# many effects are drawn in one body
@lru_cache(maxsize=4)
def _surface_of(body: Body, away: float) -> tuple[NDArray[np.int64], Floats]:
    """Nodes of the outer surface that are so far from what is held, and area vectors of all nodes."""
    other = body.nodes("ventricle") | body.nodes("superior")
    nodes = np.setdiff1d(np.unique(body.outer.nodes[:, :3]), np.flatnonzero(other))
    return nodes[_free(body, body.points[nodes])], body.outer.spread(body.outer.vectors(body.points))


def _surface(random: Random, body: Body) -> tuple[Place, Floats]:
    """A point of the outer surface and its outward normal."""
    nodes, normals = _surface_of(body, _AWAY)
    node = int(random.choice(nodes))
    around = np.linalg.norm(body.points - body.points[node], axis=1) < 0.01
    return triple(body.points[node]), unit(normals[around].sum(axis=0))


def _apart(draw: Callable[[], Place], least: float) -> tuple[Place, Place]:
    """Two places that are at least so far apart [m]."""
    here, there = draw(), draw()
    while np.linalg.norm(np.subtract(here, there)) < least:
        there = draw()
    return here, there


def _inside(random: Random, body: Body) -> Place:
    """A point well within the tissue."""
    places = body.centroids[random.permutation(len(body.centroids))[:400]]
    surface = body.points[np.unique(body.outer.nodes[:, :3])]
    depth = cKDTree(surface).query(places)[0]
    deep = places[(depth > 0.006) & _free(body, places)]
    return triple(deep[0])
