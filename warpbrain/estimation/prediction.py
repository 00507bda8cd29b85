"""What an estimate makes of recordings: of those that it was fitted to, and of those that it has not seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.estimation.modes import Mode
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.problem import GROSS

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Probabilities of the intervals whose coverage is told.
INTERVALS = (0.5, 0.95)


@dataclass(frozen=True, eq=False)
class Prediction:
    """A recording beside what the estimate makes of it.

    Attributes
    ----------
    name, kind, role, unit : str
    rows : (n,) int array
        Rows of the recording.
    before, after : (n, d) array
        Residuals with nothing moved (or no force), and those of the estimate with its nuisances.
    sigma : (n,) array or None
        Noise of one component of each row, given or estimated; None if it is not known.
    deviation : (n, d) array
        Standard deviation of the prediction itself, from the posterior to first order.
    gross : (n,) bool array
        Rows that are gross errors; none where the noise is not known.
    coverage : tuple of float or None
        Part of the components that lie in their predictive intervals of `INTERVALS`, without gross errors.
    """

    name: str
    kind: str
    role: str
    unit: str
    rows: NDArray[np.int64]
    before: Floats
    after: Floats
    sigma: Floats | None
    deviation: Floats
    gross: Bools
    coverage: tuple[float, ...] | None

    @property
    def error_before(self) -> float:
        """Root mean square of the lengths, in `unit`."""
        return _root_mean_square(self.before)

    @property
    def error_after(self) -> float:
        """Root mean square of the lengths, in `unit`."""
        return _root_mean_square(self.after)


def predictions(mode: Mode, role: str, observations: Observations, joint: Floats) -> tuple[Prediction, ...]:
    """Recordings of one role beside an estimate.

    Parameters
    ----------
    mode : Mode
    role : {"fit", "check"}
    observations : Observations
        Of that role.
    joint : (p + q, p + q) array
        Covariance of parameters and nuisances.
    """
    problem, point, derivatives = mode.estimate.problem, mode.estimate.point, mode.estimate.linearised
    centre = problem.observations.centre
    rest = observations.at(np.zeros_like(point.state.u), np.zeros_like(point.state.u), centre)
    parts = observations.at(*problem.nuisances.observed(point.state, point.nuisances), centre)
    estimated = {
        each.name: weighed.sigma for each, weighed in zip(problem.observations.each, point.weighed, strict=True)
    }
    found = []
    for observation, before, part in zip(observations.each, rest, parts, strict=True):
        after = problem.nuisances.residuals(part, point.nuisances)
        jacobian = problem.nuisances.jacobian(
            part, point.state.theta, point.nuisances, (derivatives.du, derivatives.dR)
        )
        deviation = np.sqrt(np.einsum("ndp,pq,ndq->nd", jacobian, joint, jacobian))
        sigma = observation.sigma if observation.sigma is not None else estimated.get(observation.name)
        gross = np.zeros(len(after), dtype=bool) if sigma is None else gross_errors(after, deviation, sigma)
        found.append(
            Prediction(
                observation.name,
                observation.kind,
                role,
                observation.unit,
                observation.rows,
                before.values,
                after,
                sigma,
                deviation,
                gross,
                None if sigma is None else coverage(after, deviation, sigma, gross),
            )
        )
    return tuple(found)


def gross_errors(residuals: Floats, deviation: Floats, sigma: Floats) -> Bools:
    """Rows (n,) farther away than noise and prediction pass once in ten thousand."""
    from scipy.special import gammaincinv

    squares = np.sum(residuals**2 / (deviation**2 + sigma[:, None] ** 2), axis=1)
    return np.asarray(squares > 2.0 * gammaincinv(0.5 * residuals.shape[1], GROSS))


def coverage(residuals: Floats, deviation: Floats, sigma: Floats, gross: Bools) -> tuple[float, ...] | None:
    """Part of the components in their intervals of noise and prediction, normal; None if all rows are gross errors."""
    from scipy.special import ndtri

    if gross.all():
        return None
    away = (np.abs(residuals) / np.sqrt(deviation**2 + sigma[:, None] ** 2))[~gross]
    return tuple(float(np.mean(away <= ndtri(0.5 + 0.5 * probability))) for probability in INTERVALS)


def _root_mean_square(residuals: Floats) -> float:
    return math.sqrt(float(np.mean(np.sum(residuals**2, axis=1))))
