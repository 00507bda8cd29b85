"""What is recorded of a truth: badly registered, with noise that neighbours share, and with mistakes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from referee.mistakes import draw
from referee.sensing import FORCE_ERROR
from referee.truth import Truth
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording, SurfaceRecording

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Decimals of a recorded metre: to a tenth of a micrometre.
DECIMALS = 7
#: Name of the declared load.
CAP = "superior cap"


def recordings(truth: Truth) -> tuple[Recording, ...]:
    """Everything that the case folder gets."""
    setting = truth.setting
    fitted = _points(truth, "points", "fit", truth.sensors.fitted, mistakes=True)
    checked = _points(truth, "check", "check", truth.sensors.checked, mistakes=False)
    made: list[Recording] = [fitted]
    if len(truth.sensors.wall[0]):
        made.append(_surface(truth))
    if setting.total is None:
        made.append(_force(truth))
    return (*made, checked)


def _sigma(truth: Truth) -> float | None:
    return truth.setting.sigma if truth.setting.declares_sigma else None


def _middle(truth: Truth) -> Floats:
    points = truth.setting.body.points
    return 0.5 * (points.min(axis=0) + points.max(axis=0))


def seen(truth: Truth, nodes: Ints, salt: int) -> Floats:
    """Displacement (times, k, 3) [m] of nodes as it is recorded, before mistakes; `salt` tells noises apart."""
    setting = truth.setting
    points, moved = truth.tracked(nodes)
    out = []
    for k, u in enumerate(moved):
        blur = replace(setting.blur, seed=(setting.seed + 1000 * salt + k) % 2**31)
        out.append(blur.misaligned(points, u, _middle(truth)) + blur.noise(points))
    return np.stack(out)


def _points(truth: Truth, name: str, role: str, nodes: Ints, mistakes: bool) -> PointsRecording:
    setting = truth.setting
    random = np.random.default_rng([setting.seed, 2])
    points, _ = truth.tracked(nodes)
    moved = seen(truth, nodes, 1 if mistakes else 2)
    if mistakes:
        wrong = random.random(moved.shape[:2]) < setting.gross
        moved = moved + wrong[..., None] * draw(random, wrong.shape)
        for k in random.permutation(len(nodes))[: round(0.5 * setting.mispaired * len(nodes))]:
            # with its nearest neighbour
            other = np.argsort(np.linalg.norm(points - points[k], axis=1))[1]
            ends = points[[k, other]] + moved[:, [k, other]]
            moved[:, [k, other]] = ends[:, ::-1] - points[[k, other]]
    times = np.repeat(setting.times, len(nodes)) if setting.times else None
    ids = tuple(f"{name[0].upper()}{k + 1:03d}" for k in range(len(nodes)))
    return PointsRecording(
        name=name,
        file="",
        role=role,
        sigma=_sigma(truth),
        points=np.tile(points, (len(moved), 1)),
        displacement=np.round(moved.reshape(-1, 3), DECIMALS),
        time=times,
        ids=ids * len(moved),
        outside="nearest",
    )


def _surface(truth: Truth) -> SurfaceRecording:
    setting = truth.setting
    points, u = truth.sensors.on_wall(setting.body.points), truth.sensors.on_wall(truth.u[-1])
    blur = replace(setting.blur, seed=(setting.seed + 5000) % 2**31)
    moved = np.round(points + blur.misaligned(points, u, _middle(truth)) + blur.noise(points), DECIMALS)
    return SurfaceRecording(
        name="ventricle wall", file="", role="fit", sigma=_sigma(truth), points=moved, nodes="ventricle"
    )


def _force(truth: Truth) -> ForceRecording:
    random = np.random.default_rng([truth.setting.seed, 4])
    error = FORCE_ERROR * float(np.linalg.norm(truth.force))
    force = truth.force + error * truth.setting.noise * random.normal(size=3)
    return ForceRecording(
        name="force", file="", role="fit", sigma=error, boundary=CAP, time=np.array([1.0]), force=force[None]
    )
