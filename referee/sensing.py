"""Where a truth is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from referee.body import Body
from referee.setting import Setting

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Points on the moved wall of the ventricles, and error of a force relative to it.
SURFACE_POINTS, FORCE_ERROR = 150, 0.02
#: Part of the points that lie on walls, and least distance between points [m].
_WALLS, _APART = 0.4, 0.005


@dataclass(frozen=True, eq=False)
class Sensors:
    """Nodes of the true body that are seen.

    Attributes
    ----------
    fitted, checked : int arrays
        Nodes that are tracked to be fitted, and apart to be compared with.
    wall : (nodes (p, 6), shapes (p, 6))
        Places on the wall of the ventricles: quadratic triangles and weights of their nodes. None of them if it is not
        recorded.
    """

    fitted: Ints
    checked: Ints
    wall: tuple[Ints, Floats]

    def on_wall(self, values: Floats) -> Floats:
        """Values (n, 3) of all nodes at the places on the wall (p, 3)."""
        nodes, shapes = self.wall
        return np.asarray(np.einsum("pa,pai->pi", shapes, values[nodes]))


def place_sensors(setting: Setting) -> Sensors:
    """Draw where is seen: within the tissue and on its walls, not where nothing moves freely."""
    body = setting.outlined
    random = np.random.default_rng([setting.seed if setting.sites is None else setting.sites, 1])
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
    return Sensors(np.sort(chosen[: setting.points]), np.sort(chosen[setting.points :]), _place_wall(setting))


def _place_wall(setting: Setting) -> tuple[Ints, Floats]:
    if not setting.surface or setting.times:
        return np.zeros((0, 6), dtype=np.int64), np.zeros((0, 6))
    random = np.random.default_rng([setting.seed, 3])
    faces = setting.body.faces(setting.body.mesh.node_sets["ventricle"])
    areas = faces.areas.sum(axis=1)
    chosen = random.choice(len(areas), size=SURFACE_POINTS, p=areas / areas.sum())
    r = np.sort(random.random((SURFACE_POINTS, 2)), axis=1)
    b = np.stack([r[:, 0], r[:, 1] - r[:, 0], 1.0 - r[:, 1]], axis=1)
    shapes = np.concatenate([b * (2.0 * b - 1.0), 4.0 * b * np.roll(b, -1, axis=1)], axis=1)
    return faces.nodes[chosen], shapes


def _apart(body: Body, nodes: Ints, count: int, name: str) -> Ints:
    chosen: list[int] = []
    for node in nodes.tolist():
        if not chosen or np.linalg.norm(body.points[chosen] - body.points[node], axis=1).min() > _APART:
            chosen.append(node)
        if len(chosen) == count:
            return np.array(chosen)
    raise ValueError(f"{name}: {len(chosen)} points are {1000 * _APART:g} mm apart, {count} wanted")
