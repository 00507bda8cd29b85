"""What an estimate makes of recordings: of those that it was fitted to, and of those that it has not seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments
from warpbrain.estimation.fit import Estimate
from warpbrain.estimation.likelihood import Noise
from warpbrain.estimation.observations import Observations, Sensors
from warpbrain.estimation.registration import realigned
from warpbrain.recordings.agreement import by_unit
from warpbrain.recordings.comparison import Comparison
from warpbrain.simulation.observation import observe
from warpbrain.simulation.result import NodalState

#: Probabilities of the intervals whose coverage is told.
INTERVALS = (0.5, 0.95)


@dataclass(frozen=True, eq=False)
class Prediction:
    """A recording beside what the estimate makes of it."""

    name: str
    kind: str
    role: str
    unit: str
    rows: Ints  # (n,), rows of the recording that have a weight
    before: Floats  # (n, d), their residuals with nothing moved (or no force)
    after: Floats  # (n, d), those of the estimate with its nuisances
    #: (n,), noise of one component of each row, given or estimated, its scale in it; None if it is not known
    sigma: Floats | None
    deviation: Floats  # (n, d), standard deviation of the prediction itself, from the posterior to first order
    gross: Bools  # (n,), rows that are gross errors; none where the noise is not known
    #: Part of the components that lie in their predictive intervals of `INTERVALS`, without gross errors
    coverage: tuple[float, ...] | None
    run: Comparison  # all recorded rows beside the most probable state as `warpbrain run` has it
    #: Beside the estimate: with the error of the mesh, and with what was recorded moved back by that of registration
    fitted: Comparison

    @property
    def error_before(self) -> float:
        """Root mean square of all rows with nothing moved, in `unit`."""
        return self.run.before.root_mean_square

    @property
    def error_after(self) -> float:
        """Root mean square of all rows beside the estimate, in `unit`."""
        return self.fitted.after.root_mean_square


@dataclass(frozen=True)
class OverallErrors:
    """All points and surfaces of one role: root mean square of the 3-D distance over every row [m]."""

    role: str
    count: int
    before: float  # with nothing moved
    after: float  # beside the estimate
    of_run: float  # beside its most probable state as `warpbrain run` has it

    @classmethod
    def of(cls, each: Sequence[Prediction]) -> tuple[OverallErrors, ...]:
        """Of each role that has any."""
        overall = []
        for role in dict.fromkeys(prediction.role for prediction in each if prediction.unit == "m"):
            lengths = [prediction for prediction in each if prediction.role == role and prediction.unit == "m"]
            residuals = (
                [prediction.run.residuals_before for prediction in lengths],
                [prediction.fitted.residuals_after for prediction in lengths],
                [prediction.run.residuals_after for prediction in lengths],
            )
            errors = (by_unit(("m", residual) for residual in values)["m"] for values in residuals)
            overall.append(cls(role, sum(prediction.fitted.count for prediction in lengths), *errors))
        return tuple(overall)


def predictions(
    case: Case, estimate: Estimate, role: str, observations: Observations, joint: Floats
) -> tuple[Prediction, ...]:
    """Recordings of one role, ``"fit"`` or ``"check"``, beside an estimate.

    `joint` (p + q, p + q) is the covariance of parameters and nuisances.
    """
    if not observations.recordings:
        return ()
    problem, point, derivatives = estimate.problem, estimate.point, estimate.linearised
    centre, motion = problem.observations.centre, problem.nuisances.motion(point.nuisances)
    rest = np.zeros_like(point.state.u)
    seen = problem.nuisances.observed(point.state, point.nuisances)
    before, after = observations.at(rest, rest, centre), observations.at(*seen, centre, motion)
    moments = problem.forward.moments
    run = compared(case, point.state.u, point.state.reactions, moments)
    fitted = compared(realigned(case, motion, centre), *seen, moments)
    jacobian = problem.nuisances.jacobian(after, point.state.theta, point.nuisances, derivatives.du, derivatives.dR)
    deviations = np.sqrt(np.einsum("np,pq,nq->n", jacobian, joint, jacobian))
    results = []
    for number, name in enumerate(after.names):
        members = np.flatnonzero(after.recordings == number)
        parts = [observation for observation in observations.recordings if observation.name == name]
        rows, first = np.concatenate([observation.rows for observation in parts]), parts[0]
        shape = len(rows), first.size
        seen_rows, noise = after.of_rows(members), point.noise
        if role != "fit":
            noise = _unseen(seen_rows, jacobian[members], joint, noise)
        noise_rows = members if role == "fit" else members - members[0]
        known = role == "fit" or first.sigma is not None
        gross = noise.gross[[k for k, at in enumerate(noise.rows.points) if noise_rows[0] <= at[0] <= noise_rows[-1]]]
        gross = gross if len(gross) else np.zeros(len(rows), dtype=bool)
        residual, deviation = seen_rows.residual.reshape(shape), deviations[members].reshape(shape)
        within = (
            coverage(residual, np.hypot(deviation, noise.deviation[noise_rows].reshape(shape)), gross)
            if known
            else None
        )
        sigma = (noise.scale * noise.sigma)[noise_rows].reshape(shape)[:, 0] if known else None
        about = name, first.kind, role, first.unit, rows, before.residual[members].reshape(shape), residual
        results.append(Prediction(*about, sigma, deviation, gross, within, run[name], fitted[name]))
    return tuple(results)


def _unseen(rows: Sensors, jacobian: Floats, joint: Floats, fitted: Noise) -> Noise:
    """The noise of a recording that was not fitted, its gross errors beside what the estimate knows of it."""
    sigma = np.where(np.isnan(rows.sigma), 1.0 / np.sqrt(rows.weights), rows.sigma)
    noise = Noise(rows, sigma, fitted.scale, np.ones(len(rows.points)), fitted.outliers, fitted.unresolved)
    if np.isnan(rows.sigma).any():
        return noise
    return noise.with_gross_errors(rows.residual, jacobian @ np.linalg.cholesky(joint))


def compared(case: Case, u: Floats, reactions: Floats, moments: Moments) -> Mapping[str, Comparison]:
    """Recordings by name beside displacement and reactions (s N, 3) at moments, as `warpbrain run` compares them."""
    count = len(moments.cases)
    pairs = zip(np.split(u, count), np.split(reactions, count), strict=True)
    states = [NodalState(case.remaining[0], *state) for state in pairs]
    others = {time: states[number] for time, number in zip(moments.times, moments.numbers, strict=True)}
    return {comparison.name: comparison for comparison in observe(case, states[-1], others=others).comparisons}


def coverage(residuals: Floats, deviation: Floats, gross: Bools) -> tuple[float, ...] | None:
    """Part of the components (n, d) in their normal intervals; None if all rows are gross errors."""
    from scipy.special import ndtri

    if gross.all():
        return None
    away = (np.abs(residuals) / deviation)[~gross]
    return tuple(float(np.mean(away <= ndtri(0.5 + 0.5 * probability))) for probability in INTERVALS)
