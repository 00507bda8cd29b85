"""What acts in a case, drawn at random. Nobody chooses, and the seed is written in the sealed truth alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from concealed.body import Body, Floats, Ints
from concealed.effect import Effect
from concealed.observing import Blur
from concealed.support_effects import MisjudgedLevel, Slip, TurnedHead
from concealed.tissue import Tissue
from concealed.tissue_effects import Inclusion, Swelling
from concealed.wall_effects import CavityPressure, VentricularPressure, WallTraction
from warpbrain.mesh import face_vectors

Random = np.random.Generator
#: Share of the cases in which a second effect acts.
SECOND = 0.6


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A truth before its strengths are fitted to the wanted motion.

    Attributes
    ----------
    main : Effect
        Its strength is a unit with a sign, 1 or -1: the tuning finds how much.
    others : tuple of Effect
        At the strength that was drawn.
    tissue : Tissue
    blur : Blur
    """

    main: Effect
    others: tuple[Effect, ...]
    tissue: Tissue
    blur: Blur


def draw(seed: int, attempt: int, body: Body) -> Drawn:
    """Draw what acts.

    Parameters
    ----------
    seed : int
    attempt : int
        Counts the draws of a case: what cannot reach the wanted motion at a plausible strength is drawn again.
    body : Body
        Where sites are found.
    """
    random = np.random.default_rng([seed, attempt])
    main = _MAIN[random.integers(len(_MAIN))](random, body)
    others: tuple[Effect, ...] = ()
    if random.random() < SECOND:
        others = (_SECOND[random.integers(len(_SECOND))](random, body),)
    return Drawn(main=main, others=others, tissue=_tissue(random), blur=_blur(random))


def _tissue(random: Random) -> Tissue:
    k = np.clip(random.multivariate_normal([0.0, 0.0], 0.9**2 * np.array([[1.0, 0.7], [0.7, 1.0]])), -2.0, 2.0)
    return Tissue(
        k_grey=float(k[0]),
        k_white=float(k[1]),
        alpha=(float(random.uniform(1.5, 4.0)), float(-random.uniform(5.0, 14.0))),
        share=float(random.uniform(0.4, 0.7)),
        poisson=float(random.uniform(0.46, 0.485)),
        field_sd=float(random.uniform(0.15, 0.25)),
        field_length=float(random.uniform(0.03, 0.04)),
        field_seed=int(random.integers(2**62)),
    )


def _blur(random: Random) -> Blur:
    return Blur(
        noise_scale=float(np.exp(random.uniform(np.log(0.8), np.log(1.25)))),
        shared_sigma=float(random.uniform(0.15e-3, 0.25e-3)),
        shared_length=0.02,
        shift=_vector(_direction(random) * random.uniform(0.3e-3, 0.7e-3)),
        rotation=_vector(_direction(random) * np.radians(random.uniform(0.3, 0.7))),
        seed=int(random.integers(2**62)),
    )


def _cavity_pressure(random: Random, body: Body) -> Effect:
    return CavityPressure(strength=_sign(random))


def _traction_in_cavity(random: Random, body: Body) -> Effect:
    return _traction(random, body, "cavity", body.cavity, np.inf)


def _traction_on_cortex(random: Random, body: Body) -> Effect:
    # beside the cavity, not on bone
    held = body.mesh.node_sets["fixed"][body.cortex].any(axis=1)
    return _traction(random, body, "cortex", body.cortex[~held], 0.035)


def _traction(random: Random, body: Body, wall: str, faces: Ints, reach: float) -> Effect:
    middles = body.mesh.points[faces].mean(axis=1)
    near = np.flatnonzero(np.linalg.norm(middles - body.cavity_centre, axis=1) < reach)
    face = near[random.integers(len(near))]
    inwards = -face_vectors(body.mesh.points, faces[face : face + 1])[0]
    slanted = inwards / np.linalg.norm(inwards) + 0.4 * _direction(random)
    return WallTraction(
        # pushed by an instrument more often than pulled by what it has grown together with
        strength=1.0 if random.random() < 0.7 else -1.0,
        wall=wall,
        centre=_vector(middles[face]),
        radius=float(random.uniform(0.010, 0.016)),
        direction=_vector(slanted / np.linalg.norm(slanted)),
    )


def _swelling(random: Random, body: Body) -> Effect:
    return Swelling(
        strength=float(random.uniform(0.1, 0.25)),
        centre=_beside_cavity(random, body, 0.015),
        radius=float(random.uniform(0.020, 0.040)),
    )


def _ventricular_pressure(random: Random, body: Body) -> Effect:
    return VentricularPressure(strength=_sign(random) * float(random.uniform(30.0, 150.0)))


def _inclusion(random: Random, body: Body) -> Effect:
    return Inclusion(
        strength=_sign(random) * float(random.uniform(0.7, 1.4)),
        centre=_beside_cavity(random, body, 0.03),
        radius=float(random.uniform(0.015, 0.028)),
    )


def _slip(random: Random, body: Body) -> Effect:
    return Slip(strength=float(random.uniform(0.03, 0.06)), centre=_beside_cavity(random, body, 0.01))


def _turned_head(random: Random, body: Body) -> Effect:
    return TurnedHead(strength=float(random.uniform(12.0, 30.0)))


def _misjudged_level(random: Random, body: Body) -> Effect:
    return MisjudgedLevel(strength=_sign(random) * float(random.uniform(0.010, 0.025)))


_Maker = Callable[[Random, Body], Effect]
#: What can move a cavity by as much as was published at a plausible strength, and what can act beside it.
_MAIN: tuple[_Maker, ...] = (_cavity_pressure, _traction_in_cavity, _traction_on_cortex)
_SECOND: tuple[_Maker, ...] = (
    _ventricular_pressure,
    _inclusion,
    _slip,
    _turned_head,
    _misjudged_level,
    _swelling,
)


def _beside_cavity(random: Random, body: Body, reach: float) -> tuple[float, float, float]:
    """A node within a distance [m] of the wall of the cavity."""
    points = body.mesh.points
    wall = points[np.unique(body.cavity)]
    near = points[np.linalg.norm(points - body.cavity_centre, axis=1) < reach + 0.04]
    near = near[np.linalg.norm(near[:, None] - wall[None], axis=2).min(axis=1) < reach]
    return _vector(near[random.integers(len(near))])


def _sign(random: Random) -> float:
    return 1.0 if random.random() < 0.5 else -1.0


def _direction(random: Random) -> Floats:
    vector = random.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _vector(values: Floats) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
