"""What the recordings of a case tell of a change: its rows, and their noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.sparse import csr_matrix

from referee.body import Body
from referee.sensing import FORCE_ERROR, Sensors
from referee.setting import NOISE, SHARED, SHARED_LENGTH, Setting, mean_square

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Change:
    """How a body differs from what it does without something.

    Attributes
    ----------
    move : (times, n, 3) or (1, n, 3) array
        Of all nodes [m].
    force : (3,) array
        With which the superior cap acts on the tissue in the end [N].
    """

    move: Floats
    force: Floats

    def times(self, factor: float) -> Change:
        """The same of another size."""
        return Change(factor * self.move, factor * self.force)


class Sight:
    """Rows of everything that is recorded to be fitted: points at each time, the moved wall along its normals, a force.

    A point of the wall has no partner, so that it tells nothing of motion along the wall.

    Parameters
    ----------
    setting : Setting
    sensors : Sensors
    u : (n, 3) array
        What the body does without effects [m].
    force : (3,) array
        Of the superior cap then [N].
    """

    def __init__(self, setting: Setting, sensors: Sensors, u: Floats, force: Floats) -> None:
        body: Body = setting.body
        self.setting, self._sensors, self._nodes = setting, sensors, sensors.fitted
        self._middle = 0.5 * (body.points.min(axis=0) + body.points.max(axis=0))
        self._points = body.points
        moved = body.points + u
        nodes, _ = sensors.wall
        along, across = (moved[nodes[:, k]] - moved[nodes[:, 0]] for k in (1, 2))
        normals = np.cross(along, across)
        self._normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self._places = sensors.on_wall(body.points)
        self._moved = moved
        self._force = FORCE_ERROR * float(np.linalg.norm(force)) if setting.total is None else None

    @property
    def points(self) -> Floats:
        """Points (k, 3) that are tracked [m]."""
        return self._points[self._nodes]

    @property
    def count(self) -> int:
        """How many of the rows are of points."""
        return 3 * self.often * len(self._nodes)

    @cached_property
    def numbers(self) -> Ints:
        """Rows (points, 3) of each point, at each time."""
        return np.arange(self.count).reshape(-1, 3)

    @property
    def often(self) -> int:
        """How many times points are recorded at."""
        return max(1, len(self.setting.times))

    def rows(self, change: Change) -> Floats:
        """What is recorded of a change (rows,) [m], forces [N]."""
        return self.stacked(change.move[:, self._nodes], self._sensors.on_wall(change.move[-1]), change.force)

    def stacked(self, points: Floats, wall: Floats, force: Floats) -> Floats:
        """The same of points (times or 1, k, 3), of places on the wall (p, 3) [m], and of a force (3,) [N]."""
        # what does not change with time is seen at each of them
        parts = [np.repeat(points, self.often // len(points), axis=0).ravel(), (wall * self._normals).sum(axis=1)]
        if self._force is not None:
            parts.append(force)
        return np.concatenate(parts)

    @property
    def has_force(self) -> bool:
        """Whether the force of the cap is recorded."""
        return self._force is not None

    @property
    def selection(self) -> csr_matrix:
        """Matrix (numbers, 3 n) that reads points, once, and the wall from displacements."""
        nodes, shapes = self._sensors.wall
        k, p = len(self._nodes), len(nodes)
        rows = [np.arange(3 * k), np.repeat(3 * k + np.arange(p), 18)]
        columns = [(3 * self._nodes[:, None] + np.arange(3)).ravel(), (3 * nodes[:, :, None] + np.arange(3)).ravel()]
        values = [np.ones(3 * k), (shapes[:, :, None] * self._normals[:, None, :]).ravel()]
        shape = (3 * k + p, self._points.size)
        return csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)

    def moved_rigidly(self, shift: Floats, turn: Floats) -> Floats:
        """Rows of an exact rigid motion about the middle: a shift [m] and a rotation vector [rad]."""
        blur = replace(self.setting.blur, shift=tuple(shift), rotation=tuple(turn))
        move = blur.misaligned(self._moved, np.zeros_like(self._moved), self._middle)
        return self.rows(Change(move[None], np.zeros(3)))

    @cached_property
    def rigid(self) -> Floats:
        """Rows (6, rows) of shifts of 1 m and turns of 1 rad about the middle."""
        arm = self._moved - self._middle
        moves = [np.broadcast_to(axis, arm.shape) for axis in np.eye(3)]
        moves += [np.cross(axis, arm) for axis in np.eye(3)]
        return np.stack([self.rows(Change(move[None], np.zeros(3))) for move in moves])

    @cached_property
    def noise(self) -> Floats:
        """Covariance (rows, rows) of noise as it is drawn, without gross errors."""
        setting = self.setting
        # mean square of its scale, which nobody declares
        square = mean_square(NOISE) * setting.sigma**2
        points = _noise(self.points, square)
        points = np.kron(np.eye(self.often), np.kron(points, np.eye(3)))
        aligned = self._normals @ self._normals.T
        wall = _noise(self._places, square) * aligned
        blocks = [points, wall]
        if self._force is not None:
            blocks.append(self._force**2 * square / setting.sigma**2 * np.eye(3))
        return block_diag(*blocks)


def _noise(points: Floats, square: float) -> Floats:
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    return square * (np.eye(len(points)) + SHARED**2 * np.exp(-apart / SHARED_LENGTH))
