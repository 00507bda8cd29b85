"""What is known of a case's tissue after its recordings: the answer of an estimation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments
from warpbrain.estimation.finer_mesh import DiscretisationError
from warpbrain.estimation.fit import Estimate, probabilities
from warpbrain.estimation.likelihood import Noise
from warpbrain.estimation.observations import Observations, Sensors
from warpbrain.estimation.options import EstimationOptions
from warpbrain.estimation.parameters import Parameter, Parameters
from warpbrain.estimation.registration import realigned
from warpbrain.estimation.sampling import Chain, Importance
from warpbrain.estimation.surplus import Surplus
from warpbrain.gp.prior import Prior
from warpbrain.mesh.refinement import finer_mesh
from warpbrain.physics.words import enumerated
from warpbrain.recordings.comparison import Comparison, by_unit
from warpbrain.shown import Shown
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
            residuals = [(p.run.residuals_before, p.fitted.residuals_after, p.run.residuals_after) for p in lengths]
            errors = (by_unit(("m", residual) for residual in values)["m"] for values in zip(*residuals, strict=True))
            overall.append(cls(role, sum(prediction.fitted.count for prediction in lengths), *errors))
        return tuple(overall)


def predictions(
    case: Case, estimate: Estimate, role: str, observations: Observations, joint: Floats
) -> tuple[Prediction, ...]:
    """Recordings of one role, ``"fit"`` or ``"check"``, beside an estimate.

    `joint` (p + q, p + q) is the covariance of parameters and nuisances in standard deviations of their prior.
    """
    from scipy.special import ndtri

    if not observations.recordings:
        return ()
    problem, point, derivatives = estimate.problem, estimate.point, estimate.linearised.derivatives
    centre, motion = problem.observations.centre, problem.nuisances.motion(point.nuisances)
    rest = np.zeros_like(point.state.u)
    seen = problem.nuisances.observed(point.state, point.nuisances)
    before = observations.at(rest, rest, centre)
    after = problem.seen(point.state, point.nuisances, observations)
    moments = problem.forward.moments
    run = compared(case, point.state.u, point.state.reactions, moments)
    surplus = problem.nuisances.surplus_at(estimate.theta)
    fitted = compared(realigned(case, motion, centre), *seen, moments, surplus)
    columns = problem.columns(after, estimate.theta, point.nuisances, derivatives)
    deviations = np.sqrt(np.einsum("np,pq,nq->n", columns, joint, columns))
    results = []
    for number, name in enumerate(after.names):
        members = np.flatnonzero(after.recordings == number)
        parts = [observation for observation in observations.recordings if observation.name == name]
        rows, first = np.concatenate([observation.rows for observation in parts]), parts[0]
        shape = len(rows), first.size
        seen_rows = after.of_rows(members)
        if role == "fit":
            noise, noise_rows = point.noise, members
        else:
            noise = _noise_of_unfitted(seen_rows, point.noise, columns[members] @ np.linalg.cholesky(joint))
            noise_rows = members - members[0]
        known = role == "fit" or first.sigma is not None
        gross = noise.gross[[k for k, at in enumerate(noise.rows.points) if noise_rows[0] <= at[0] <= noise_rows[-1]]]
        gross = gross if len(gross) else np.zeros(len(rows), dtype=bool)
        residual, deviation = seen_rows.residual.reshape(shape), deviations[members].reshape(shape)
        within = None
        if known and not gross.all():
            away = (np.abs(residual) / np.hypot(deviation, noise.deviation[noise_rows].reshape(shape)))[~gross]
            within = tuple(float(np.mean(away <= ndtri(0.5 + 0.5 * probability))) for probability in INTERVALS)
        sigma = (noise.scale * noise.sigma)[noise_rows].reshape(shape)[:, 0] if known else None
        about = name, first.kind, role, first.unit, rows, before.residual[members].reshape(shape), residual
        results.append(Prediction(*about, sigma, deviation, gross, within, run[name], fitted[name]))
    return tuple(results)


def _noise_of_unfitted(rows: Sensors, fitted: Noise, columns: Floats) -> Noise:
    """Noise of a recording that was not fitted, its gross errors beside what the estimate knows of it.

    `columns` (n, k): of that, of one standard deviation each. Where no noise is declared nothing is a gross error.
    """
    undeclared = np.isnan(rows.sigma)
    sigma = np.where(undeclared, 1.0 / np.sqrt(rows.weights), rows.sigma)
    noise = Noise.of(rows, sigma, fitted.unresolved, fitted.outliers, fitted.scale)
    return noise if undeclared.any() else noise.with_gross_errors(rows.residual, columns)


def compared(
    case: Case, u: Floats, reactions: Floats, moments: Moments, within: Surplus | None = None
) -> Mapping[str, Comparison]:
    """Recordings by name beside displacement and reactions (s N, 3) at moments, as `warpbrain run` compares them.

    `within`: displacement within elements, of values (s, E, 3), where it is known.
    """
    count, mesh = len(moments.cases), case.remaining[0]
    fields = u.reshape(count, -1, 3), reactions.reshape(count, -1, 3)
    if within is not None:
        mesh, nothing = finer_mesh(mesh)[0], np.zeros_like(within.values)
        fields = within.with_middles(fields[0]), np.concatenate([fields[1], nothing], axis=1)
    states = [NodalState(mesh, *state) for state in zip(*fields, strict=True)]
    others = {time: states[number] for time, number in zip(moments.times, moments.numbers, strict=True)}
    return {comparison.name: comparison for comparison in observe(case, states[-1], others=others).comparisons}


#: Gains from which a direction is told, since the data know more of it than the prior did and the variance at least
#: halves, and below which it is hidden: an estimate along it is the prior, and no finding.
TOLD, HIDDEN = 1.0, 0.1
#: Parts of a direction smaller than this, in standard deviations of the prior, are not spoken of.
_NEGLIGIBLE = 0.1
#: A change of the moduli that moves the body by less than this part of its displacement moves nothing.
_UNMOVED = 1e-4
#: Two parts of a direction that differ by less than this are the same.
_ALIKE = 0.1
#: How a combination of parameters is told, and a change: of one, of moduli alike, of any.
_COMBINATION = "the {}", "the geometric mean of the shear moduli of {}", "the combination {}"
_CHANGE = "a change of the {}", "a change of the shear moduli of {} by one factor", "a change along {}"


@dataclass(frozen=True)
class Identifiability:
    """A verdict."""

    informed: tuple[str, ...]  # combinations of parameters that the data tell
    weakly_informed: tuple[str, ...]  # and that they tell a little
    hidden: tuple[str, ...]  # changes of the parameters that the data do not see
    #: All shear moduli together can be changed by a factor, and the data do not see it: the loads are displacements
    #: only, and no force was recorded
    scale_is_hidden: bool

    @property
    def nothing(self) -> bool:
        """The data say nothing: the posterior is the prior."""
        return not self.informed and not self.weakly_informed

    @property
    def sentences(self) -> tuple[str, ...]:
        """For people to read."""
        sentences = []
        if self.nothing:
            sentences.append(
                "Not identifiable: the recordings say nothing of the tissue. What is given is the prior, no finding."
            )
        if self.informed:
            sentences.append(f"The recordings inform {enumerated(self.informed)}.")
        if self.weakly_informed:
            sentences.append(f"They inform a little {enumerated(self.weakly_informed)}.")
        if self.hidden and not self.nothing:
            sentences.append(f"They do not see {enumerated(self.hidden)}: there the estimate is the prior.")
        if self.scale_is_hidden:
            sentences.append(
                "Absolute stiffness cannot be told from displacements that displacements cause: a recorded force, or a "
                "load that is known, such as weight, would tell it."
            )
        return tuple(sentences)


def identifiability(estimate: Estimate) -> Identifiability:
    """What the data of an estimate inform."""
    posterior = estimate.laplace
    parameters, gains = tuple(posterior.parameters), posterior.gains
    informed, hidden = gains >= TOLD, gains < HIDDEN
    # one prior standard deviation of a parameter is the unit in which changes of different kinds compare
    unit = posterior.prior.standard_deviations
    # a factor on all moduli moves nothing if displacements do it all, and everything under a weight or a force
    scale = posterior.parameters.is_modulus.astype(np.float64)
    moved = np.linalg.norm(np.tensordot(scale, estimate.linearised.derivatives[0], axes=1))
    known = float(scale @ posterior.information @ scale) / float(scale @ posterior.prior.precision @ scale)

    def combinations(rows: Floats) -> tuple[str, ...]:
        return tuple(in_words(parameters, row / unit, _COMBINATION) for row in _reduced(rows * unit))

    return Identifiability(
        combinations(posterior.combinations[informed]),
        combinations(posterior.combinations[~informed & ~hidden]),
        tuple(in_words(parameters, row * unit, _CHANGE) for row in _reduced(posterior.directions[hidden] / unit)),
        known < HIDDEN and bool(moved <= _UNMOVED * np.linalg.norm(estimate.point.state.u)),
    )


def _reduced(rows: Floats) -> Floats:
    """Other rows of the same span, each with a 1 where the others have zeros: the fewest parameters in each."""
    rows = rows.copy()
    for k in range(len(rows)):
        column = int(np.abs(rows[k]).argmax())
        rows[k] /= rows[k, column]
        others = np.arange(len(rows)) != k
        rows[others] -= np.outer(rows[others, column], rows[k])
    return np.where(np.abs(rows) >= _NEGLIGIBLE * np.abs(rows).max(axis=1, keepdims=True, initial=0.0), rows, 0.0)


def in_words(parameters: Sequence[Parameter], row: Floats, words: tuple[str, str, str]) -> str:
    """A direction (p,) in parameters of their own units; those with a weight of zero are not in it."""
    single, alike, other = words
    weights = row / row[np.abs(row).argmax()]
    parts = [(parameters[k], float(weights[k])) for k in np.flatnonzero(weights).tolist()]
    if len(parts) == 1:
        return single.format(f"{parts[0][0].coordinate.noun} of {parts[0][0].tissue}")
    if all(parameter.is_modulus for parameter, _ in parts):
        tissues = enumerated([parameter.tissue for parameter, _ in parts])
        if max(weight for _, weight in parts) - min(weight for _, weight in parts) < _ALIKE:
            return alike.format(tissues)
        if len(parts) == 2 and abs(parts[0][1] + parts[1][1]) < _ALIKE:
            return single.format(f"ratio of the shear moduli of {tissues}")
    return other.format(" ".join(f"{weight:+.2g} [{parameter.name}]" for parameter, weight in parts))


@dataclass(frozen=True, eq=False)
class Marginal:
    """What is known of one parameter."""

    parameter: Parameter
    estimate: float  # the most probable value
    mean: float
    deviation: float
    interval: tuple[float, float]  # 95 % of the posterior and of the prior lie between, as much below as above
    prior_mean: float
    prior_deviation: float
    prior_interval: tuple[float, float]

    @property
    def shrinkage(self) -> float:
        """By how much of the prior's the standard deviation fell: 0, nothing was learnt; 1, all."""
        return 1.0 - self.deviation / self.prior_deviation


@dataclass(frozen=True, eq=False)
class Posterior(Shown):
    """The answer.

    Attributes
    ----------
    case : Case
    options : EstimationOptions
    prior : Prior
    modes : tuple of Estimate
        The most probable first.
    remarks : tuple of str
        What a user should know of how it was found.
    mesh_errors : tuple of DiscretisationError
        The error of the mesh each time it was computed; the last one counts. Empty if it was left out.
    importance : Importance
        The check of Laplace's approximation.
    doubts : tuple of str
        Why that is not to be believed; empty if it is.
    chain : Chain or None
        What takes its place then.
    solves : mapping of str to int
        Equilibria by what they were for.
    seconds : mapping of str to float
        Wall time by stage.
    """

    case: Case
    options: EstimationOptions
    prior: Prior
    modes: tuple[Estimate, ...]
    remarks: tuple[str, ...]
    mesh_errors: tuple[DiscretisationError, ...]
    importance: Importance
    doubts: tuple[str, ...]
    chain: Chain | None
    solves: Mapping[str, int]
    seconds: Mapping[str, float]

    @property
    def best(self) -> Estimate:
        """The most probable mode."""
        return self.modes[0]

    @property
    def parameters(self) -> Parameters:
        """What `theta` means."""
        return self.best.problem.parameters

    @property
    def method(self) -> str:
        """``"laplace"`` or ``"chain"``: what marginals and correlation are of."""
        return "laplace" if self.chain is None else "chain"

    @property
    def theta(self) -> Floats:
        """The most probable parameters, shape (p,)."""
        return self.best.theta

    @property
    def mode_probabilities(self) -> Floats:
        """Of each mode by Laplace."""
        return probabilities(self.modes)

    @cached_property
    def covariance(self) -> Floats:
        """Of the parameters, shape (p, p)."""
        if self.chain is None:
            return self.best.laplace.posterior.covariance
        return np.atleast_2d(np.cov(self.chain.theta, rowvar=False))

    @property
    def correlation(self) -> Floats:
        """Shape (p, p)."""
        deviations = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(deviations, deviations)

    def interval(self, probability: float) -> Floats:
        """Central interval of each parameter, shape (p, 2)."""
        if self.chain is None:
            return self.best.laplace.interval(probability)
        ends = [50.0 - 50.0 * probability, 50.0 + 50.0 * probability]
        return np.asarray(np.percentile(self.chain.theta, ends, axis=0).T)

    @cached_property
    def marginals(self) -> tuple[Marginal, ...]:
        """Each parameter."""
        prior = np.percentile(self.prior.theta, [2.5, 97.5], axis=0).T
        mean = self.theta if self.chain is None else self.chain.theta.mean(axis=0)
        deviations, of_prior = (np.sqrt(np.diag(C)) for C in (self.covariance, self.prior.covariance))
        columns = self.theta, mean, deviations, self.interval(0.95), self.prior.mean, of_prior, prior
        each = zip(self.parameters, *(column.tolist() for column in columns), strict=True)
        return tuple(
            Marginal(parameter, top, middle, sd, (low, high), prior_mean, prior_sd, (least, most))
            for parameter, top, middle, sd, (low, high), prior_mean, prior_sd, (least, most) in each
        )

    @cached_property
    def joint_covariance(self) -> Floats:
        """Of parameters and nuisances in standard deviations of their prior by Laplace, shape (p + q, p + q)."""
        point, linearised, problem = self.best.point, self.best.linearised, self.best.problem
        columns = problem.columns(point.rows, self.theta, point.nuisances, linearised.derivatives)
        return point.model.of_noise(columns, point.noise.scale).coefficients(point.residual)[1]

    @property
    def nuisances(self) -> tuple[tuple[str, float, float], ...]:
        """Name, estimate and standard deviation of each."""
        nuisances, values = self.best.problem.nuisances, self.best.point.nuisances
        variances = np.diag(self.joint_covariance)[len(self.parameters) :]
        deviations = nuisances.prior.standard_deviations * np.sqrt(variances)
        return tuple(zip(nuisances.names, values.tolist(), deviations.tolist(), strict=True))

    @cached_property
    def identifiability(self) -> Identifiability:
        """What the recordings tell at all."""
        return identifiability(self.best)

    @cached_property
    def predictions(self) -> tuple[Prediction, ...]:
        """Recordings that were fitted, then those that check; these are looked at here for the first time."""
        problem, about = self.best.problem, (self.case, self.best)
        unseen = Observations.to_check(self.case, problem.forward.moments)
        both = (("fit", problem.observations), ("check", unseen))
        return tuple(each for pair in both for each in predictions(*about, *pair, self.joint_covariance))

    @property
    def overall_errors(self) -> tuple[OverallErrors, ...]:
        """Errors over all rows of points and surfaces, of those that were fitted and of those that check."""
        return OverallErrors.of(self.predictions)
