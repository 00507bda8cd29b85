"""Cases that share a declared body and its sensors: what is large is there once for all of them.

A body has the rows of its points, of every node of a recorded wall along each axis, and of the force. A case has what
was recorded, and where the points of its wall are among these nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from referee.challenge.neutral import Floats, Ints, NeutralCase, Strings
from referee.challenge.noise import Noise, covariance_of

#: Stand in a `case.toml` for what each case has for itself: its name, and the declared noise of its force.
NAME, FORCE_NOISE = "<name>", "<noise of the force>"
#: Arrays of `NeutralCase` that are linear in what is read: (rows, ...).
COLUMNS = ("nuisance_response", "cause_response", "site_response")
#: What each case has for itself; all else is the body's.
_OWN = ("name", "recorded", "noise_covariance")
SHARED = tuple(field.name for field in fields(NeutralCase) if field.name not in _OWN)


@dataclass(frozen=True, eq=False, kw_only=True)
class Tracked:
    """Points that are tracked in all cases of a body.

    Attributes
    ----------
    label : (k,) array of str
    place : (k, 3) array
        At rest [m]; once for each time.
    time : (k,) array
        [s]; NaN where none is told.
    moved : (cases, k, 3) array
        Displacement [m].
    """

    label: Strings
    place: Floats
    time: Floats
    moved: Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class SharedBody:
    """A declared body, its sensors, and what was recorded of it in each of its cases.

    Attributes
    ----------
    rows : dict of str to array
        Arrays of `NeutralCase` by name, `SHARED` of them: of the points to be fitted, then the nodes of the wall along
        x, y and z, then the force.
    noise : Noise
    sigma : (rows,) array
        Declared noise of each row [m], or what is taken for it; of the force that is the case's.
    wall_faces : (f, 3) int array
        Nodes of each triangle of the recorded wall; none if it is not recorded.
    text : str
        Of the `case.toml`, `NAME` and `FORCE_NOISE` where those of the case are.
    mesh : str
        File of the declared mesh, which is beside that of the body.
    names : (cases,) array of str
    fitted, checked : Tracked
    wall : (cases, p, 3) array
        Points of the moved wall [m].
    wall_face : (cases, p) int array
        Triangle of the declared moved wall that each is nearest to.
    wall_weight : (cases, p, 3) array
        Of its nodes, where on it.
    force : (cases, 3) or (cases, 0) array
        [N]
    force_sigma : (cases,) array
        Its declared noise [N]; NaN if it is not recorded.
    """

    rows: dict[str, NDArray[Any]]
    noise: Noise
    sigma: Floats
    wall_faces: Ints
    text: str
    mesh: str
    names: Strings
    fitted: Tracked
    checked: Tracked
    wall: Floats
    wall_face: Ints
    wall_weight: Floats
    force: Floats
    force_sigma: Floats

    def case(self, k: int) -> NeutralCase:
        """Its case of number `k`."""
        points, after = 3 * len(self.fitted.label), len(self.sigma) - self.force.shape[1]
        nodes = slice(points, after)
        corners = self.wall_faces[self.wall_face[k]]
        weight, p = self.wall_weight[k], len(corners)
        rest = self.rows["sensor_place"][nodes][::3]
        moved = rest + self.rows["predicted"][nodes].reshape(-1, 3)
        along, across = (moved[corners[:, j]] - moved[corners[:, 0]] for j in (1, 2))
        normal = np.cross(along, across)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        place = np.einsum("pa,pai->pi", weight, rest[corners])
        # reads the wall along its normal from its nodes
        reading = np.zeros((p, after - points))
        columns = 3 * corners[:, :, None] + np.arange(3)
        reading[np.arange(p)[:, None, None], columns] = weight[:, :, None] * normal[:, None, :]

        def with_wall(values: NDArray[Any], wall: NDArray[Any]) -> NDArray[Any]:
            return np.concatenate([values[:points], wall, values[after:]])

        made = dict(self.rows)
        for name in ("predicted", *COLUMNS):
            made[name] = with_wall(made[name], np.tensordot(reading, made[name][nodes], axes=1))
        of_wall = {
            "sensor_place": place,
            "sensor_direction": normal,
            "sensor_kind": np.full(p, "wall"),
            "sensor_time": np.full(p, np.nan),
            "sensor_point": points // 3 + np.arange(p),
        }
        made |= {name: with_wall(made[name], wall) for name, wall in of_wall.items()}
        # a component of the force is a measurement
        made["sensor_point"][points + p :] = points // 3 + p + np.arange(self.force.shape[1])
        seen = ((self.wall[k] - place) * normal).sum(axis=1)
        sigma = with_wall(self.sigma, np.broadcast_to(self.sigma[nodes][:1], p))
        sigma[points + p :] = self.force_sigma[k]
        sensors = (made[f"sensor_{name}"] for name in ("place", "direction", "kind", "time"))
        return NeutralCase(
            name=str(self.names[k]),
            recorded=np.concatenate([self.fitted.moved[k].ravel(), seen, self.force[k]]),
            noise_covariance=covariance_of(self.noise, *sensors, sigma),
            **made,
        )
