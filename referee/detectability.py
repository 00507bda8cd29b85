"""How well an effect could be seen by anybody who knows how cases are drawn, but not this draw."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from referee.setting import SHARED, SHARED_LENGTH, SHIFT, TURN
from referee.sight import Change, Sight
from referee.unknowns import Unknowns

Floats = NDArray[np.float64]

#: For the upper bound: error of registration [m] and [rad], logarithm of stiffness of each tissue.
UPPER_SHIFT, UPPER_TURN, UPPER_STIFFNESS = 2e-3, float(np.deg2rad(2.0)), 0.5

#: Standard deviation of what another effect may be as well, in parts of the size at which it stands out by 1.
WIDE = 100.0


def covariance(sight: Sight, unknown: Floats) -> Floats:
    """Covariance (rows, rows) of noise, registration, and rows (k, rows) that are not known by a unit each."""
    spreads = np.repeat([SHIFT, TURN], 3) / np.sqrt(3.0)
    columns = np.concatenate([spreads[:, None] * sight.rigid, unknown])
    whole: Floats = sight.noise + columns.T @ columns
    return whole


def conditional(delta: Floats, others: Floats, precision: Floats) -> float:
    """``d`` of a change (rows,) where amounts of others (k, rows) are not known, by Woodbury's identity.

    Parameters
    ----------
    delta, others : arrays
    precision : (rows, rows) array
        Inverse of the covariance without the others.
    """
    own = precision @ delta
    stand = np.sqrt(np.einsum("kr,rs,ks->k", others, precision, others))
    columns = others[stand > 0.0] / stand[stand > 0.0, None]
    gram = columns @ precision @ columns.T + np.eye(len(columns)) / WIDE**2
    seen = columns @ own
    return float(np.sqrt(max(delta @ own - seen @ np.linalg.solve(gram, seen), 0.0)))


class Detectability:
    """``d = sqrt(D^T S^-1 D)`` of what a change shows, in units of all that is not known.

    `S` holds everything that is drawn and not told, each with a normal prior of the spread that it is drawn with: noise
    (its mean scale; gross errors as points that are lost), registration, the stiffness of all tissue, of each tissue
    and its field, Poisson's ratio and the shape of the law. Only that is left of a change which these cannot explain.

    Parameters
    ----------
    sight : Sight
    unknowns : Unknowns
    """

    def __init__(self, sight: Sight, unknowns: Unknowns) -> None:
        self._sight = sight
        self._factor = cho_factor(covariance(sight, np.stack([sight.rows(change) for change in unknowns.drawn])))
        self._upper = cho_factor(_upper(sight, unknowns))

    def d(self, change: Change) -> float:
        """Of all recordings."""
        delta = self._sight.rows(change)
        return float(np.sqrt(delta @ cho_solve(self._factor, delta)))

    def given(self, change: Change, others: Sequence[Change]) -> float:
        """Of all recordings, where the amounts of other changes are not known."""
        rows = np.stack([self._sight.rows(other) for other in others])
        precision = cho_solve(self._factor, np.eye(rows.shape[1]))
        return conditional(self._sight.rows(change), rows, precision)

    def upper(self, change: Change) -> float:
        """The old measure, which run 1 was drawn and scored by: of points alone.

        It knows the declared noise, a rigid motion and the stiffness of each tissue. The last two are wider than they
        are drawn, and neither the wall nor the force is in it: so it is a bound of what points show, not of `d`.
        """
        delta = self._sight.rows(change)[: self._sight.count]
        return float(np.sqrt(delta @ cho_solve(self._upper, delta)))


def _upper(sight: Sight, unknowns: Unknowns) -> Floats:
    points, sigma = sight.points, sight.setting.sigma
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    shared = (SHARED * sigma) ** 2 * np.exp(-apart / SHARED_LENGTH)
    noise = np.kron(np.eye(sight.often), np.kron(sigma**2 * np.eye(len(points)) + shared, np.eye(3)))
    arm = points - points.mean(axis=0)
    turns = np.stack([np.cross(axis, arm).ravel() for axis in np.eye(3)])
    shifts = np.stack([np.tile(axis, len(points)) for axis in np.eye(3)])
    rigid = np.tile(np.concatenate([UPPER_SHIFT * shifts, UPPER_TURN * turns]), (1, sight.often))
    stiffness = [UPPER_STIFFNESS * sight.rows(change)[: sight.count] for change in unknowns.tissues]
    columns = np.concatenate([rigid, stiffness])
    return noise + columns.T @ columns
