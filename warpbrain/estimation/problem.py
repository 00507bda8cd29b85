"""Likelihood times prior of a case's parameters, at a point and to first order about it.

Beside the tissue nuisances act on the recordings, which are no property of it: the error of the mesh (`finer_mesh`), 37
numbers, and a rigid error of registration, six. As in a diagnosis they are columns `U` of a linear model

    r = U xi + e,   xi ~ N(0, I),   e: the noise (`likelihood`)

of what was recorded less what parameters make of it, and integrated out. The motion is no linear thing, nor is the
error of the mesh: they are linear about values that are found again and again until they are the most probable ones.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.finer_mesh import NAMES as DISCRETISATION_NAMES
from warpbrain.estimation.finer_mesh import Discretisation, DiscretisationError
from warpbrain.estimation.forward import Forward, State
from warpbrain.estimation.likelihood import Likelihood, Noise
from warpbrain.estimation.observations import Observations, Sensors
from warpbrain.estimation.parameters import Gaussian, Parameters, PriorMode
from warpbrain.estimation.registration import NAMES as REGISTRATION_NAMES
from warpbrain.estimation.surplus import Surplus
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.recordings.base import Registration

#: Nuisances are at their best when they move by less than this [standard deviations of what is known of them then], and
#: how often they are moved at most.
_AT_BEST, _MOST = 1e-4, 10


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

    @cached_property
    def prior(self) -> Gaussian:
        """Before anything was observed."""
        means, deviations = np.zeros(len(self.names)), np.zeros(len(self.names))
        if self.error is not None and self.discretisation is not None:
            means[0], deviations[0] = self.discretisation.mean, self.discretisation.deviation
            deviations[1 : len(DISCRETISATION_NAMES)] = self.discretisation.shape
        if self.registration is not None:
            deviations[-6:] = self.registration.deviations
        return Gaussian(means, np.diag(deviations**2))

    def standardised(self, values: Floats) -> Floats:
        """Values (q,) as coordinates `xi` (q,)."""
        return (values - self.prior.mean) / self.prior.standard_deviations

    def observed(self, state: State, values: Floats) -> tuple[Floats, Floats]:
        """Displacement and reactions (n, 3) without the error of the mesh."""
        if self.error is None:
            return state.u, state.reactions
        u, reactions = self.error.at(state.theta, values[: len(DISCRETISATION_NAMES)])
        return state.u + u, state.reactions + reactions

    def surplus_at(self, theta: Floats) -> Surplus | None:
        """Displacement within elements at parameters (p,), of values (s, E, 3); None where it is not known."""
        return None if self.error is None else self.error.surplus_at(theta)

    def motion(self, values: Floats) -> Floats:
        """Rigid motion (6,) of what was recorded."""
        return np.zeros(6) if self.registration is None else values[-6:]

    def columns(self, rows: Sensors, theta: Floats, values: Floats) -> Floats:
        """What one standard deviation of each changes of what is recorded, about values (q,): (n, q)."""
        blocks = [np.zeros((len(rows), 0))]
        if self.error is not None:
            blocks.append(rows.answers_in_time(*self.error.by_values(theta, values[: len(DISCRETISATION_NAMES)])))
        if self.registration is not None:
            blocks.append(rows.rigid)
        return np.concatenate(blocks, axis=1) @ self.prior.factor

    def tissue_columns(self, rows: Sensors, values: Floats, du: Floats, dR: Floats) -> Floats:
        """What parameters change of what is recorded (n, p), by the derivatives (p, n, 3) of the state."""
        if self.error is None:
            return rows.answers_in_time(du, dR)
        more_du, more_dR = self.error.by_theta(values[: len(DISCRETISATION_NAMES)])
        within = rows.answers_within_in_time(self.error.change.surplus.edges, self.error.dsurplus)
        return rows.answers_in_time(du + more_du, dR + more_dR) + within


@dataclass(frozen=True, eq=False)
class Point:
    """Parameters with everything that is known there."""

    state: State
    nuisances: Floats  # (q,), values that they are linear about
    rows: Sensors  # with these taken off
    noise: Noise
    model: GaussianModel  # of the rows, with the nuisances as its columns
    residual: Floats  # (n,), of that model: with nuisances in the middle of their prior
    misfit: float  # `-ln` of the likelihood
    objective: float  # with that of the prior


@dataclass(frozen=True, eq=False)
class Linearised:
    """A point to first order in `theta`."""

    columns: Floats  # (n, p), change of what is recorded by `theta`
    information: Floats  # (p, p), of the data alone
    derivatives: tuple[Floats, Floats]  # (p, N, 3), of displacement [m] and reactions [N] by `theta`


@dataclass(frozen=True, eq=False)
class Problem:
    forward: Forward
    observations: Observations
    mode: PriorMode
    likelihood: Likelihood
    nuisances: Nuisances

    @property
    def parameters(self) -> Parameters:
        return self.forward.parameters

    def seen(self, state: State, nuisances: Floats, observations: Observations | None = None) -> Sensors:
        """What was recorded beside a state, values of nuisances (q,) taken off; of other observations if given."""
        observed, motion = self.nuisances.observed(state, nuisances), self.nuisances.motion(nuisances)
        rows = (observations or self.observations).at(*observed, self.observations.centre, motion)
        if (surplus := self.nuisances.surplus_at(state.theta)) is None:
            return rows
        return rows.with_change(rows.answers_within_in_time(surplus.edges, surplus.values[None])[:, 0])

    def at(self, state: State, nuisances: Floats, noise: Noise, model: GaussianModel | None = None) -> Point:
        """The objective at a state, nuisances linear about some values (q,) of them; or with the columns of a model."""
        rows = self.seen(state, nuisances)
        if model is None:
            model = noise.model.of_noise(self.nuisances.columns(rows, state.theta, nuisances), noise.scale)
        residual = rows.residual + model.columns @ self.nuisances.standardised(nuisances)
        misfit = -float(model.log_density(residual)) - noise.log_prior
        objective = misfit + self.mode.gaussian.negative_log(state.theta)
        return Point(state, nuisances, rows, noise, model, residual, misfit, objective)

    def at_best(self, point: Point) -> Point:
        """The same with nuisances linear about their most probable values; no equilibrium is solved."""
        prior = self.nuisances.prior
        for _ in range(_MOST):
            xi, _ = point.model.coefficients(point.residual)
            change = xi - self.nuisances.standardised(point.nuisances)
            seen = point.model.whitened(point.model.columns @ change)
            if np.linalg.norm(np.concatenate([seen, change])) <= _AT_BEST:
                break
            point = self.at(point.state, prior.mean + prior.standard_deviations * xi, point.noise)
        return point

    def linearise(self, point: Point, derivatives: tuple[Floats, Floats] | None = None) -> Linearised:
        """Derivatives at a point, from those of its state, or `SolveError` if that is unstable."""
        known = self.forward.differentiate(point.state) if derivatives is None else derivatives
        columns = self.nuisances.tissue_columns(point.rows, point.nuisances, *known)
        J = point.model.standardised(columns)
        return Linearised(columns, J.T @ J, known)

    def likely_noise(self, state: State, nuisances: Floats, derivatives: tuple[Floats, Floats]) -> Noise:
        """The most probable noise about a state with its derivatives, everything that is estimated integrated out."""
        rows, prior = self.seen(state, nuisances), self.mode.gaussian
        columns = self.columns(rows, state.theta, nuisances, derivatives)
        z = np.concatenate(
            [np.linalg.solve(prior.factor, state.theta - prior.mean), self.nuisances.standardised(nuisances)]
        )
        return self.likelihood.noise(rows, rows.residual + columns @ z, columns)

    def columns(self, rows: Sensors, theta: Floats, nuisances: Floats, derivatives: tuple[Floats, Floats]) -> Floats:
        """What one standard deviation of each parameter and nuisance changes of what is recorded: (n, p + q)."""
        tissue = self.nuisances.tissue_columns(rows, nuisances, *derivatives) @ self.mode.gaussian.factor
        return np.concatenate([tissue, self.nuisances.columns(rows, theta, nuisances)], axis=1)
