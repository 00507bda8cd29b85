"""A case in units of all that is not known, as every baseline takes it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from referee.challenge.neutral import Floats, Ints, NeutralCase, Strings

#: Gross errors as docs/referee.md tells them: root mean square of a component [m], and the share of points at most.
_GROSS, _SHARE = 3.1e-3 / np.sqrt(3.0), 0.08
#: A point is one whose squared length, in units of what the others leave of it, is above this: 1 in 6000 by chance.
_UNLIKELY = 20.0


@dataclass(frozen=True, eq=False)
class Whitened:
    """A linear model of unit noise.

    Attributes
    ----------
    name : str
    y : (n,) array
        What the declared body leaves unexplained.
    columns : (n, k) array
        Responses of causes.
    causes : (k,) array of str
    candidates : (k,) int array
        Columns of the same number are one cause at one place.
    lower : (n, n) array
        Factor by which was divided: ``lower @ lower.T`` is the covariance.
    case : NeutralCase
    """

    name: str
    y: Floats
    columns: Floats
    causes: Strings
    candidates: Ints
    lower: Floats
    case: NeutralCase

    @property
    def groups(self) -> list[tuple[str, Ints]]:
        """Name of the cause and numbers of the columns of each candidate."""
        return [
            (str(self.causes[own[0]]), own)
            for own in (np.flatnonzero(self.candidates == number) for number in np.unique(self.candidates))
        ]


def whitened(case: NeutralCase) -> Whitened:
    """A case in units of noise and nuisances, points with gross errors given the spread of these."""
    covariance = _with_gross_errors(case)
    lower = np.linalg.cholesky(covariance)
    seen = solve_triangular(lower, np.column_stack([case.residual, case.cause_response]), lower=True)
    columns = seen[:, 1:]
    # what nobody could see at any amount is no candidate
    kept = np.linalg.norm(columns, axis=0) > 1e-3 * np.linalg.norm(columns, axis=0).max()
    return Whitened(
        case.name, seen[:, 0], columns[:, kept], case.cause_name[kept], case.cause_candidate[kept], lower, case
    )


def _with_gross_errors(case: NeutralCase) -> Floats:
    """Covariance, the worst point at a time found wrong by what the others leave of it, as long as one is unlikely."""
    covariance, residual = case.covariance, case.residual
    points = np.unique(case.sensor_point[case.sensor_kind == "displacement"])
    rows = [np.flatnonzero(case.sensor_point == point) for point in points]
    for _ in range(int(_SHARE * len(points))):
        precision = np.linalg.inv(covariance)
        weighed = precision @ residual
        # b^T A^-1 b with the block A of the precision: the leave-one-out residual over its own covariance
        worst = [float(weighed[own] @ np.linalg.solve(precision[np.ix_(own, own)], weighed[own])) for own in rows]
        k = int(np.argmax(worst))
        if worst[k] < _UNLIKELY:
            break
        covariance[rows[k], rows[k]] += _GROSS**2
    return covariance
