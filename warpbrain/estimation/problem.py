"""Likelihood times prior of a case's parameters, at a point and to first order about it.

Beside the tissue nuisances are estimated: what acts on the recordings and is no property of it, the error of the mesh
(`finer_mesh`), 37 numbers, and a rigid error of registration, six. Both have normal distributions beforehand and are
integrated out of what is said of the tissue.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.finer_mesh import NAMES as DISCRETISATION_NAMES
from warpbrain.estimation.finer_mesh import Discretisation, DiscretisationError
from warpbrain.estimation.forward import Forward, State
from warpbrain.estimation.likelihood import IndependentNoise, Likelihood, Noise
from warpbrain.estimation.observations import Observations, Sensors
from warpbrain.estimation.parameters import Gaussian, Parameters, PriorMode
from warpbrain.estimation.registration import NAMES as REGISTRATION_NAMES
from warpbrain.inference.least_squares import minimise
from warpbrain.recordings.base import Registration

#: Nuisances are at their best when the next step is shorter than this [standard deviations].
_AT_BEST = 1e-5


@dataclass(frozen=True, eq=False)
class Nuisances:
    """The nuisances of an estimation; a vector of q numbers holds those that there are, in this order."""

    discretisation: Discretisation | None = None  # with `error`; without them states are taken for exact
    error: DiscretisationError | None = None
    registration: Registration | None = None  # without it positions are taken as they were recorded

    @property
    def names(self) -> tuple[str, ...]:
        """With units."""
        first = DISCRETISATION_NAMES if self.error is not None else ()
        return first + (REGISTRATION_NAMES if self.registration is not None else ())

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def prior(self) -> Gaussian:
        """Before anything was observed."""
        means, deviations = [np.zeros(0)], [np.zeros(0)]
        if self.error is not None and self.discretisation is not None:
            means.append(self.discretisation.means)
            deviations.append(self.discretisation.deviations)
        if self.registration is not None:
            means.append(np.zeros(6))
            deviations.append(self.registration.deviations)
        return Gaussian(np.concatenate(means), np.diag(np.concatenate(deviations) ** 2))

    def observed(self, state: State, values: Floats) -> tuple[Floats, Floats]:
        """Displacement and reactions (n, 3) without the error of the mesh."""
        if self.error is None:
            return state.u, state.reactions
        u, reactions = self.error.at(state.theta, values[: len(DISCRETISATION_NAMES)])
        return state.u + u, state.reactions + reactions

    def motion(self, values: Floats) -> Floats:
        """Rigid motion (6,) of what was recorded."""
        return np.zeros(6) if self.registration is None else values[-6:]

    def columns(self, rows: Sensors, theta: Floats, values: Floats) -> Floats:
        """Derivatives (n, q) of the residuals of rows by the nuisances."""
        blocks = [np.zeros((len(rows), 0))]
        if self.error is not None:
            blocks.append(-rows.answers_in_time(*self.error.by_values(theta, values[: len(DISCRETISATION_NAMES)])))
        if self.registration is not None:
            blocks.append(-rows.rigid)
        return np.concatenate(blocks, axis=1)

    def jacobian(self, rows: Sensors, theta: Floats, values: Floats, du: Floats, dR: Floats) -> Floats:
        """Derivatives (n, p + q) of residuals by `theta`, from those of the state (p, n, 3), and by the nuisances."""
        if self.error is not None:
            more_du, more_dR = self.error.by_theta(values[: len(DISCRETISATION_NAMES)])
            du, dR = du + more_du, dR + more_dR
        return np.concatenate([-rows.answers_in_time(du, dR), self.columns(rows, theta, values)], axis=1)


@dataclass(frozen=True, eq=False)
class Point:
    """Parameters with everything that is known there."""

    state: State
    nuisances: Floats  # (q,)
    rows: Sensors  # with a rigid motion of what was recorded taken off
    noise: Noise
    misfit: float  # `-ln` of the likelihood and of the nuisances' density
    objective: float  # with that of the prior

    @property
    def coordinates(self) -> Floats:
        """Parameters and nuisances, shape (p + q,)."""
        return np.concatenate([self.state.theta, self.nuisances])


@dataclass(frozen=True, eq=False)
class Linearised:
    """Derivatives of the objective at a point by `theta` and the nuisances, p + q numbers."""

    jacobian: Floats  # (n, p + q), of the residuals
    information: Floats  # (p + q, p + q), of the data alone
    hessian: Floats  # of the objective, to first order in the residuals: positive definite
    du: Floats  # (p, N, 3), of the displacement [m] by `theta`
    dR: Floats  # (p, N, 3), of the reactions [N]


@dataclass(frozen=True, eq=False)
class Problem:
    """What is estimated from what."""

    forward: Forward
    observations: Observations
    mode: PriorMode
    likelihood: Likelihood
    nuisances: Nuisances

    @property
    def parameters(self) -> Parameters:
        """What `theta` means."""
        return self.forward.parameters

    @cached_property
    def prior(self) -> Gaussian:
        """Of parameters and nuisances together."""
        from scipy.linalg import block_diag

        tissue, nuisances = self.mode.gaussian, self.nuisances.prior
        mean = np.concatenate([tissue.mean, nuisances.mean])
        return Gaussian(mean, block_diag(tissue.covariance, nuisances.covariance))

    def at(self, state: State, nuisances: Floats, noise: Noise | None = None) -> Point:
        """The objective at a state; noise that is as large as the residuals are, unless it is known."""
        seen = self.nuisances.observed(state, nuisances)
        rows = self.observations.at(*seen, motion=self.nuisances.motion(nuisances))
        known = IndependentNoise.as_large_as(rows) if noise is None else noise
        misfit = known.negative_log(rows.residual) + self.nuisances.prior.negative_log(nuisances)
        return Point(state, nuisances, rows, known, misfit, misfit + self.mode.gaussian.negative_log(state.theta))

    def linearise(self, point: Point, derivatives: tuple[Floats, Floats] | None = None) -> Linearised:
        """Derivatives at a point, from those of its state, or `SolveError` if that is unstable."""
        du, dR = self.forward.differentiate(point.state) if derivatives is None else derivatives
        jacobian = self.nuisances.jacobian(point.rows, point.state.theta, point.nuisances, du, dR)
        J = point.noise.standardised(jacobian)
        return Linearised(jacobian, J.T @ J, J.T @ J + self.prior.precision, du, dR)

    def with_likely_noise(self, point: Point, linearised: Linearised) -> Point:
        """The point with the most probable noise, everything that is estimated integrated out about it."""
        columns, residual = linearised.jacobian @ self.prior.factor, point.rows.residual
        expected = residual + linearised.jacobian @ (self.prior.mean - point.coordinates)
        noise = self.likelihood.noise(point.rows, residual, expected, columns)
        return self.at(point.state, point.nuisances, noise)

    def without_nuisances(self, state: State, start: Floats, noise: Noise) -> tuple[float, Point]:
        """`-ln` of the likelihood of a state with the nuisances integrated out (Laplace), and their best values.

        No equilibrium is solved: nuisances act on what is observed of the state.
        """
        prior, point = self.nuisances.prior, self.at(state, start, noise)
        if len(self.nuisances) == 0:
            return point.misfit, point
        size = prior.standard_deviations

        def rows(z: Floats) -> Floats:
            nonlocal point
            point = self.at(state, prior.mean + size * z, noise)
            return np.concatenate([noise.standardised(point.rows.residual), z])

        def columns(z: Floats) -> Floats:
            at = self.nuisances.columns(point.rows, state.theta, prior.mean + size * z)
            return np.concatenate([noise.standardised(at * size), np.eye(len(z))])

        z, _ = minimise(rows, columns, (start - prior.mean) / size, _AT_BEST)
        rows(z)
        W = columns(z)
        log_volume = np.linalg.slogdet(W.T @ W)[1] - 2.0 * np.log(size).sum()
        return point.misfit + 0.5 * float(log_volume), point
