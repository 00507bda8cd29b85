"""The base state, about which all is linear: the case as declared, its tissue refitted together with a smooth force.

Nuisances that are fitted as if nothing were missing imitate what is missing; fitted together with an arbitrary smooth
force they do not. Under a large load one Gauss-Newton step from the declared state is not enough. Further steps keep
its columns, with the residuals of the state that was reached, as long as each is much shorter than the one before it.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.options import Listener
from warpbrain.estimation.parameters import Gaussian, declared, tissue_prior
from warpbrain.estimation.registration import registration_of
from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.gross_errors import columns_of_inflation, with_gross_errors
from warpbrain.inference.noise import outliers, scales
from warpbrain.mesh.refinement import finer_mesh
from warpbrain.simulation.locking import on_linear_elements
from warpbrain.threads import beside
from warpbrain.worlds.body.effects import Effect, Effects, SolvedSwitches
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.mesh_error import FinerStates, MeshErrors, expected
from warpbrain.worlds.body.nuisances import FIELD, Nuisances, nuisances_at, other_volume
from warpbrain.worlds.body.sensors import Sensors, noise_of, tracked_points
from warpbrain.worlds.body.sources import sources
from warpbrain.worlds.body.states import Hypothesis, SolvedState, States
from warpbrain.worlds.body.unknown import Field, body_forces, fields, resistances

#: Gauss-Newton steps at most; the last one moves tissue and field by less than this [standard deviations].
_STEPS, _CONVERGED = 6, 0.5
#: Part of the step before at most, for the next one to keep its columns.
_CONTRACTION = 0.5
#: What is smaller than this part of the noise everywhere is not looked for.
_UNSEEN = 0.1


@dataclass(frozen=True, eq=False)
class Base:
    """The base state and everything that is linear about it."""

    states: States
    prior: Gaussian  # of the tissues' parameters
    declared: SolvedState  # the case as declared
    state: SolvedState  # the base
    at: Linearisation
    effects: Effects
    nuisances: Nuisances
    unknown: dict[str, Field]  # without a name, by what they are
    begun_sources: Callable[[], tuple[Effect, ...]]  # which waits for `sources`
    resistance: Floats  # (n, k), unknown, of tissue; see `resistances`
    #: Of the rows if no cause acts: nuisances, and noise without gross errors or what the mesh does not resolve.
    model: GaussianModel
    #: The same noise without columns, and with what the mesh does not resolve, of each size of `mesh.unresolved`; of
    #: the first alone where all are next to nothing.
    noises: tuple[GaussianModel, ...]
    noise: Floats  # (n,), standard deviation of the independent noise of each row
    typical_noise: float  # median of that of displacements [m]; of all rows if none was recorded
    points: tuple[Ints, ...]  # rows of each recorded point
    residual: Floats  # (n,), of the linear model with all nuisances at their prior mean
    mesh_errors: MeshErrors | None  # of the base; None: the mesh is taken for exact
    remarks: tuple[str, ...]

    @cached_property
    def sources(self) -> tuple[Effect, ...]:
        """Unknown, in one place."""
        return self.begun_sources()

    def for_sensors(self, sensors: Sensors) -> tuple[Nuisances, Effects]:
        """Nuisances as columns over other sensors, in the same coordinates, and what makes effects over them."""
        at = self.at.with_sensors(sensors)
        effects = self.effects.over(at)
        theta, like = self.state.hypothesis.theta, self.nuisances
        return nuisances_at(at, self.states, theta, self.prior, effects, self.mesh_errors, like), effects

    def at_points(self, points: Floats) -> tuple[Nuisances, Effects]:
        """The same of the displacement of other points (k, 3) [m]."""
        return self.for_sensors(tracked_points(self.at.system.model.mesh, points, self.states.centre))


class BaseFinder:
    """Finds the base of a case.

    `spacing`: between sites [m]. `prior`: of the tissues' parameters, if it is not `tissue_prior`.
    """

    def __init__(
        self,
        states: States,
        spacing: float,
        mesh_error: bool,
        without_nuisances: bool,
        listener: Listener,
        prior: Gaussian | None = None,
    ) -> None:
        self.states = states
        # drawn from the generative model in a thread, while the first state is solved
        self._prior = beside(lambda: prior or tissue_prior(states.case, states.parameters))
        # elements of half the size, that a state's error is computed with
        self._finer = beside(lambda: finer_mesh(states.case.remaining[0])) if mesh_error else None
        self._spacing, self._without_nuisances = spacing, without_nuisances
        self._listener = listener
        self._remarks = on_linear_elements(states.case.poisson, "a diagnosis")

    @cached_property
    def prior(self) -> Gaussian:
        """Of the tissues' parameters."""
        return self._prior()

    def find(self) -> Base:
        """The base state; `SolveError` if the case as declared has no equilibrium."""
        self._listener.stage("the case as declared")
        declared = self.states.solve(self._declared())
        self._listener.stage("tissue beside any smooth force")
        state, linear = declared, _LinearModel(self, declared, None)
        last = np.inf
        for _ in range(_STEPS):
            hypothesis = self._next_hypothesis(linear)
            before, after = (
                linear.nuisances.coordinates(self.prior, point) for point in (state.hypothesis, hypothesis)
            )
            try:
                state = self.states.solve(hypothesis, state.u)
            except (SolveError, InputError):
                # realigned recordings have other residuals
                state = self.states.solve(state.hypothesis, state.u)
                break
            length = float(np.abs(after - before).max())
            if length < _CONVERGED:
                break
            contracts = length <= _CONTRACTION * last
            linear = linear.with_residual_of(state) if contracts else _LinearModel(self, state, None)
            last = length
        self._listener.stage("the error of the mesh, and the compliance of the body at the sensors")
        errors = self._errors_of_mesh(state)
        if errors is not None:
            state = self.states.corrected(state, expected(errors.error))
        return self._base(declared, state, errors)

    def _base(self, declared: SolvedState, state: SolvedState, errors: MeshErrors | None) -> Base:
        linear = _LinearModel(self, state, errors)
        # products with the compliance, which leave Python's lock alone, beside candidates that do not
        begun_sources = beside(partial(sources, linear.at, self._spacing, linear.typical_noise))
        unknown = fields(linear.at, linear.lengths, linear.body_forces)
        smooth = next(iter(unknown.values())).columns
        nuisances, noise = linear.nuisances, linear.noise_model
        if errors is not None and not self._without_nuisances:
            nuisances = _with_likely_fraction(nuisances, noise, linear.residual, linear.typical_noise * smooth)
        return Base(
            states=self.states,
            prior=self.prior,
            declared=declared,
            state=state,
            at=linear.at,
            effects=linear.effects,
            nuisances=nuisances,
            unknown=unknown,
            begun_sources=begun_sources,
            resistance=resistances(linear.at, self.states.times, other_volume(self.states), smooth),
            model=noise.of_noise(nuisances.columns),
            noises=_noises(linear, resolved=errors is None or self._without_nuisances),
            noise=linear.noise,
            typical_noise=linear.typical_noise,
            points=linear.at.sensors.points,
            residual=linear.residual,
            mesh_errors=errors,
            remarks=tuple(self._remarks),
        )

    def _next_hypothesis(self, linear: _LinearModel) -> Hypothesis:
        """Tissue and field fitted together with a smooth force; recordings are realigned."""
        nuisances = linear.nuisances
        # until points of a surface are compared with the right faces the registration may seem wrong by more than it is
        registration, factor = nuisances.part("registration"), belief("registration.rough")
        columns = np.column_stack([nuisances.columns, linear.smooth_force, factor * nuisances.columns[:, registration]])
        model = linear.noise_model.of_noise(columns)
        values, log_prior = scales()
        model = model.with_scale(model.likely_scale(linear.residual, values, log_prior))
        points = linear.at.sensors.points
        inflation = with_gross_errors(model, linear.residual, points, outliers()).inflation
        model = model.with_columns(columns_of_inflation(model, points, inflation))
        xi, _ = model.coefficients(linear.residual)
        count = columns.shape[1]
        deviations = registration_of(self.states.case).deviations
        self.states.realign((xi[registration] + factor * xi[count - 6 : count]) * deviations)
        farthest = belief("tissue.farthest_base")
        tissue = np.clip(xi[nuisances.part("tissue")], -farthest, farthest)
        field = np.clip(xi[nuisances.part(FIELD)], -farthest, farthest)
        return Hypothesis(self.prior.mean + self.prior.factor @ tissue, field)

    def _declared(self) -> Hypothesis:
        field = np.zeros(self.states.modes.shape[1])
        try:
            theta = declared(self.states.case, self.states.parameters)
        except InputError:
            theta = self.prior.mean.copy()
        return Hypothesis(theta, field)

    def _errors_of_mesh(self, state: SolvedState) -> MeshErrors | None:
        if self._finer is None:
            return None
        try:
            self._finer()
            return FinerStates(self.states).errors(state, self.prior)
        except (SolveError, InputError) as error:
            self._remarks.append(f"the error of the mesh is not known: {error}")
            return None


class _LinearModel:
    """The linear model about a state: nuisances, residual, noise."""

    def __init__(self, finder: BaseFinder, state: SolvedState, errors: MeshErrors | None) -> None:
        sensors, states = state.sensors, finder.states
        self.at = state.linearised()
        self.effects = Effects(self.at, SolvedSwitches(states, state))
        # first, since it makes the compliance, with which nuisances are products instead of equilibria
        self.lengths = (finder._spacing * beliefs("unknown.lengths")).tolist()
        self.body_forces = body_forces(self.at, self.lengths)
        smooth = np.column_stack([force.columns for force in self.body_forces])
        nuisances = nuisances_at(self.at, states, state.hypothesis.theta, finder.prior, self.effects, errors)
        self.nuisances = nuisances.weakened() if finder._without_nuisances else nuisances
        # with tissue and field at their prior mean, not as the state has them
        self._finder = finder
        self.residual = self._residual_at_mean(state)
        rows = sensors.is_displacement
        size = float(np.sqrt(np.mean(self.residual[rows] ** 2))) if rows.any() else 1.0
        #: Columns of smooth forces as large as the residuals.
        self.smooth_force = size * smooth
        self.noise = noise_of(sensors, self.residual, self.nuisances.columns, smooth)
        self.noise_model = sensors.noise(self.noise)
        self.typical_noise = float(np.median(self.noise[sensors.of_one_unit]))

    def _residual_at_mean(self, state: SolvedState) -> Floats:
        """Residual of the linear model about a state with its tissue, field and motion at their prior mean."""
        z = self.nuisances.coordinates(self._finder.prior, state.hypothesis)
        z[self.nuisances.part("registration")] = self._finder.states.motion_coordinates
        return np.asarray(state.sensors.residual + self.nuisances.columns @ z)

    def with_residual_of(self, state: SolvedState) -> _LinearModel:
        """The same columns with the residual of a state nearby: a compliance costs as much as many states."""
        other = copy.copy(self)
        other.residual = self._residual_at_mean(state)
        return other


def _noises(linear: _LinearModel, resolved: bool) -> tuple[GaussianModel, ...]:
    """Noise with each size of what the mesh does not resolve; the first one alone if that is `resolved`."""
    sensors = linear.at.sensors
    sizes = beliefs("mesh.unresolved")
    visible = sizes.max() * np.linalg.norm(sensors.over_element, axis=1) > _UNSEEN * linear.noise
    further = sizes[1:].tolist() if visible.any() and not resolved else []
    return linear.noise_model, *(sensors.noise(linear.noise, size) for size in further)


def _with_likely_fraction(nuisances: Nuisances, noise: GaussianModel, residual: Floats, smooth: Floats) -> Nuisances:
    """Nuisances with the posterior root mean square of the unknown part of the mesh's error.

    It depends on the mesh, the load and the sensors; if it is overestimated it hides what is missing. Its evidence is
    that of models with and without a smooth force, so that a missing cause is not taken for an error of the mesh.

    `noise`: without columns.
    `residual` (n,).
    `smooth` (n, k): columns of a smooth force as large as the noise.
    """
    from scipy.special import logsumexp, softmax

    fractions = beliefs("mesh.unknown")
    values, log_prior = scales()
    scores = []
    for fraction in fractions.tolist():
        model = noise.of_noise(nuisances.with_fraction(fraction).columns)
        models = [model, *(model.with_columns(size * smooth) for size in beliefs("unknown.sizes")[1:-1].tolist())]
        logs = [alternative.log_marginal(residual, values, log_prior) for alternative in models]
        scores.append(logsumexp([logs[0], logsumexp(logs[1:]) - np.log(len(logs) - 1)]))
    return nuisances.with_fraction(float(np.sqrt(softmax(scores) @ fractions**2)))
