"""Where a truth is seen, and how well an effect could be seen there by anybody."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from referee.body import Body
from referee.setting import SHARED, SHARED_LENGTH, Setting

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: What is taken as known beforehand: error of registration [m] and [rad], logarithm of stiffness of each tissue.
SHIFT, TURN, STIFFNESS = 2e-3, np.deg2rad(2.0), 0.5
#: Part of the points that lie on walls, and least distance between points [m].
_WALLS, _APART = 0.4, 0.005


@dataclass(frozen=True, eq=False)
class Sensors:
    """Nodes of the true body that are seen.

    Attributes
    ----------
    fitted, checked : int arrays
        Nodes that are tracked to be fitted, and apart to be compared with.
    """

    fitted: Ints
    checked: Ints


def place_sensors(setting: Setting) -> Sensors:
    """Draw where is seen: within the tissue and on its walls, not where nothing moves freely."""
    body = setting.body
    random = np.random.default_rng([setting.seed, 1])
    known = body.nodes("fixed") | body.nodes("superior") | body.nodes("side")
    wall = np.zeros(len(known), dtype=bool)
    wall[body.outer.nodes] = True
    # what is published are places, and a corner of the surface is one on the declared surface too
    corner = np.arange(len(known)) < len(body.mesh.points)
    walls, inside = (random.permutation(np.flatnonzero(kind & ~known & corner)) for kind in (wall, ~wall))
    count = setting.points + setting.checks
    many = round(_WALLS * count)
    chosen = np.concatenate(
        [_apart(body, walls, many, setting.geometry), _apart(body, inside, count - many, setting.geometry)]
    )
    chosen = random.permutation(chosen)
    return Sensors(np.sort(chosen[: setting.points]), np.sort(chosen[setting.points :]))


def _apart(body: Body, nodes: Ints, count: int, name: str) -> Ints:
    chosen: list[int] = []
    for node in nodes.tolist():
        if not chosen or np.linalg.norm(body.points[chosen] - body.points[node], axis=1).min() > _APART:
            chosen.append(node)
        if len(chosen) == count:
            return np.array(chosen)
    raise ValueError(f"{name}: {len(chosen)} points are {1000 * _APART:g} mm apart, {count} wanted")


def detectability(points: Floats, effect: Floats, stiffness: Floats, sigma: float) -> float:
    """How far an effect stands out of all that is not known of a case, ``sqrt(D^T S^-1 D)``.

    `S` holds noise as it is declared (each point's own, and what neighbours share), a rigid motion and the stiffness of
    each tissue, all with a normal prior: what these can explain does not count. Neither the tool's mesh nor its
    stiffness that varies within a tissue is in it, so that it is an upper bound of what the tool can see.

    Parameters
    ----------
    points : (k, 3) array
        Where is seen [m].
    effect : (times, k, 3) array
        Displacement that is due to the effect [m].
    stiffness : (tissues, k, 3) array
        Change of displacement with the logarithm of each tissue's stiffness [m].
    sigma : float
        [m]
    """
    times, k, _ = effect.shape
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    shared = (SHARED * sigma) ** 2 * np.exp(-apart / SHARED_LENGTH)
    noise = np.kron(np.eye(times), np.kron(sigma**2 * np.eye(k) + shared, np.eye(3)))
    arm = points - points.mean(axis=0)
    turns = np.stack([np.cross(axis, arm) for axis in np.eye(3)])
    shifts = np.broadcast_to(np.eye(3)[:, None, :], (3, k, 3))
    columns = np.concatenate([SHIFT * shifts, TURN * turns, STIFFNESS * stiffness])
    nuisance = np.tile(columns.reshape(len(columns), -1), (1, times))
    delta = effect.ravel()
    return float(np.sqrt(delta @ cho_solve(cho_factor(noise + nuisance.T @ nuisance), delta)))
