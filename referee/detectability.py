"""How well an effect could be seen by anybody who knows how cases are drawn, but not this draw."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from referee.mistakes import Bools, Mixture, draw
from referee.setting import SHARED, SHARED_LENGTH, SHIFT, TURN
from referee.sight import Change, Sight
from referee.unknowns import Unknowns

Floats = NDArray[np.float64]

#: For the upper bound: error of registration [m] and [rad], logarithm of stiffness of each tissue.
UPPER_SHIFT, UPPER_TURN, UPPER_STIFFNESS = 2e-3, float(np.deg2rad(2.0)), 0.5

#: Standard deviation of what another effect may be as well, in parts of the size at which it stands out by 1.
WIDE = 100.0
#: Draws of what is recorded without a change, each with its opposite, and how often its size is corrected at most.
_DRAWS, _CORRECTIONS = 12, 3


def covariance(sight: Sight, unknown: Floats) -> Floats:
    """Covariance (rows, rows) of noise, registration, and rows (k, rows) that are not known by a unit each."""
    spreads = np.repeat([SHIFT, TURN], 3) / np.sqrt(3.0)
    columns = np.concatenate([spreads[:, None] * sight.rigid, unknown])
    whole: Floats = sight.noise + columns.T @ columns
    return whole


def without(others: Floats, precision: Floats) -> Floats:
    """Precision (rows, rows) where amounts of others (k, rows) are not known either, by Woodbury's identity."""
    stand: Floats = np.sqrt(np.asarray(np.einsum("kr,rs,ks->k", others, precision, others)))
    columns = others[stand > 0.0] / stand[stand > 0.0, None]
    weighted = columns @ precision
    gram = weighted @ columns.T + np.eye(len(columns)) / WIDE**2
    return np.asarray(precision - weighted.T @ np.linalg.solve(gram, weighted))


def conditional(delta: Floats, others: Floats, precision: Floats) -> float:
    """``d`` of a change (rows,) where amounts of others (k, rows) are not known, without gross errors."""
    return float(np.sqrt(max(float(delta @ without(others, precision) @ delta), 0.0)))


class Spread:
    """What is recorded without a change, as it is drawn with all that is not known, and how far from it a change is.

    Parameters
    ----------
    sight : Sight
    whole : (rows, rows) array
        Covariance of all that is not known, if no point is mistaken.
    """

    def __init__(self, sight: Sight, whole: Floats) -> None:
        self.precision: Floats = np.asarray(np.linalg.inv(whole))
        self._sight = sight
        share = sight.setting.gross
        random = np.random.default_rng([sight.setting.seed, 12])
        normal = random.normal(size=(_DRAWS, len(whole))) @ np.linalg.cholesky(whole).T
        self._wrong: Bools = random.random((_DRAWS, len(sight.numbers))) < share
        normal[:, sight.numbers] += self._wrong[..., None] * draw(random, self._wrong.shape)
        self._drawn = normal

    def plain(self, delta: Floats) -> float:
        """How much a change (rows,) would stand out without gross errors."""
        return float(np.sqrt(delta @ self.precision @ delta))

    @property
    def _both(self) -> Iterator[tuple[Floats, Bools]]:
        """Each draw and its opposite: what is linear in it is no matter of chance then; which points are mistaken."""
        return ((sign * e, wrong) for e, wrong in zip(self._drawn, self._wrong, strict=True) for sign in (1.0, -1.0))

    def _mixture(self, precision: Floats) -> tuple[Mixture, list[float]]:
        """Densities by a precision, and the logarithms of those of all draws."""
        mixture = Mixture(precision, self._sight.numbers, self._sight.setting.gross)
        return mixture, [mixture.log_density(e, wrong)[0] for e, wrong in self._both]

    @cached_property
    def _alone(self) -> tuple[Mixture, list[float]]:
        return self._mixture(self.precision)

    def d(self, delta: Floats, others: Floats | None = None) -> float:
        """How much a change (rows,) stands out, where amounts of others (k, rows) are not known.

        Half its square is by how much what is recorded with the change is more probable with it than without, as
        logarithms and in the mean. Without gross errors that is ``D^T S^-1 D / 2``; with them it is no more, since they
        are the same with and without the change.
        """
        if others is None:
            precision, (mixture, before) = self.precision, self._alone
        else:
            precision = without(others, self.precision)
            mixture, before = self._mixture(precision)
        after = [mixture.log_density(e + delta, wrong)[0] for e, wrong in self._both]
        ratios = np.subtract(before, after)
        square = min(2.0 * float(np.mean(ratios)), float(delta @ precision @ delta))
        return float(np.sqrt(max(square, 0.0)))


class Detectability:
    """``d`` of what a change shows, in units of all that is not known.

    `S` holds everything that is drawn and not told, each with a normal prior of the spread that it is drawn with: noise
    (its mean scale), registration, the stiffness of all tissue, of each tissue and its field, Poisson's ratio and the
    shape of the law. Beside that any point may be mistaken. Only that is left of a change which these cannot explain.

    Parameters
    ----------
    sight : Sight
    unknowns : Unknowns
    """

    def __init__(self, sight: Sight, unknowns: Unknowns) -> None:
        self._sight = sight
        self._spread = Spread(sight, covariance(sight, np.stack([sight.rows(change) for change in unknowns.drawn])))
        self._upper = cho_factor(_upper(sight, unknowns))

    def d(self, change: Change) -> float:
        """Of all recordings."""
        return self._spread.d(self._sight.rows(change))

    def given(self, change: Change, others: Sequence[Change]) -> float:
        """Of all recordings, where the amounts of other changes are not known."""
        return self._spread.d(self._sight.rows(change), np.stack([self._sight.rows(other) for other in others]))

    def factor(self, change: Change, wanted: float) -> float:
        """How many times larger a change stands out by as much as is wanted, about."""
        delta = self._sight.rows(change)
        factor = wanted / max(self._spread.plain(delta), 1e-9)
        for _ in range(_CORRECTIONS):
            factor *= wanted / max(self._spread.d(factor * delta), 1e-9)
        return factor

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
