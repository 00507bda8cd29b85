"""The state that everything is compared at: the case as declared, its tissue refitted beside any smooth force.

Nuisances fitted as if nothing were missing imitate what is missing; fitted beside a force that may be anything they do
not. Where the load is large one round from the declared state is not enough: columns there are off by a third. In the
rounds after it they serve as well, since residuals are those of the state that was reached.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.gross_errors import columns_of_inflation, with_gross_errors
from warpbrain.inference.noise import noise_factor, outliers, scales
from warpbrain.simulation.locking import on_linear_elements
from warpbrain.threads import beside
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.mesh_error import FinerStates, MeshErrors, expected
from warpbrain.worlds.body.nuisances import Nuisances, nuisances_at, other_volume, registration_sd
from warpbrain.worlds.body.sensing import noise_of
from warpbrain.worlds.body.sensors import Sensors, rows_of_points, tracked_points
from warpbrain.worlds.body.states import Hypothesis, SolvedState, States
from warpbrain.worlds.body.switching import Solving
from warpbrain.worlds.body.tissue_prior import declared, tissue_prior
from warpbrain.worlds.body.unknown import body_forces, fields
from warpbrain.worlds.listener import Listener

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Rounds at most, and by how much less tissue and field move in the last one [standard deviations].
_ROUNDS, _NEAR = 3, 0.5


@dataclass(frozen=True, eq=False)
class Base:
    """The base state and everything that is linear about it.

    Attributes
    ----------
    states : States
    prior : Gaussian
        Of the tissues' parameters.
    declared : SolvedState
        The case as declared.
    state : SolvedState
        The base.
    at : Linearisation
    effects : Effects
    known : dict of str to SolvedState
        What was solved beside the base for them.
    nuisances : Nuisances
    unknown : dict of str to (n, k) array
        Columns of fields without a name, of 1 m.
    model : GaussianModel
        Of the rows where nothing is missing: noise of every point as if it were sound, and nuisances.
    noise : (n,) array
        Standard deviation of the independent noise of each row.
    points : tuple of int arrays
        Rows of each recorded point.
    residual : (n,) array
        Of the linear model with all nuisances in the middle of their prior.
    mesh_errors : MeshErrors or None
        Of the base; None: the mesh is taken for exact.
    remarks : tuple of str
    """

    states: States
    prior: Gaussian
    declared: SolvedState
    state: SolvedState
    at: Linearisation
    effects: Effects
    known: dict[str, SolvedState]
    nuisances: Nuisances
    unknown: dict[str, Floats]
    model: GaussianModel
    noise: Floats
    points: tuple[Ints, ...]
    residual: Floats
    mesh_errors: MeshErrors | None
    remarks: tuple[str, ...]

    @property
    def typical_noise(self) -> float:
        """Median of the noise of displacements [m]; of all rows if none was recorded."""
        lengths = self.at.sensors.is_displacement
        return float(np.median(self.noise[lengths] if lengths.any() else self.noise))

    def seen_by(self, sensors: Sensors) -> tuple[Nuisances, Effects]:
        """What nuisances do to other sensors, in the coordinates that they have here, and what makes effects there."""
        at = self.at.with_sensors(sensors)
        effects = Effects(at, Solving(self.states, self.state, at.sensors, self.known), self.mesh_errors)
        theta, own = self.state.hypothesis.theta, self.nuisances
        return nuisances_at(
            at, self.states, theta, self.prior, effects, self.mesh_errors, own.anchors, own.fraction
        ), effects

    def elsewhere(self, points: Floats) -> tuple[Nuisances, Effects]:
        """The same of the displacement of other points (k, 3) [m]."""
        return self.seen_by(tracked_points(self.at.system.model.mesh, points, self.states.centre))


class BaseFinder:
    """Finds the base of a case.

    Parameters
    ----------
    states : States
    spacing : float
        Between sites [m].
    mesh_error : bool
    without_nuisances : bool
    listener : Listener
    prior : Gaussian, optional
        Of the tissues' parameters, if it is not `tissue_prior`.
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
        # a second of drawing from the generative model, while the first state is solved
        self._prior = beside(lambda: prior or tissue_prior(states.case, states.parameters))
        self._spacing, self._mesh_error, self._bare = spacing, mesh_error, without_nuisances
        self._listener = listener
        self._remarks = on_linear_elements(states.case.poisson, "a diagnosis")

    @cached_property
    def prior(self) -> Gaussian:
        """Of the tissues' parameters."""
        return self._prior()

    def find(self) -> Base:
        """The base state.

        Raises
        ------
        SolveError
            If the case as declared has no equilibrium.
        """
        self._listener.stage("the case as declared")
        first = self.states.solve(self._declared())
        self._listener.stage("tissue beside any smooth force")
        state, rough = first, _Linear(self, first, None)
        for _ in range(_ROUNDS):
            hypothesis = self._freed(rough)
            before, after = (rough.nuisances.coordinates(self.prior, one) for one in (state.hypothesis, hypothesis))
            try:
                state = self.states.solve(hypothesis, state.u)
            except (SolveError, InputError):
                # with recordings where they are taken to be now
                state = self.states.solve(state.hypothesis, state.u)
                break
            if np.abs(after - before).max() < _NEAR:
                break
            rough = rough.moved(state)
        self._listener.stage("the error of the mesh, and the compliance of the body at the sensors")
        errors = self._errors_of_mesh(state)
        if errors is not None:
            state = self.states.corrected(state, expected(errors.own))
        return self._base(first, state, errors)

    def _base(self, first: SolvedState, state: SolvedState, errors: MeshErrors | None) -> Base:
        linear = _Linear(self, state, errors)
        unknown = fields(linear.at, linear.lengths, linear.body_forces)
        nuisances, factor = linear.nuisances, linear.noise_factor
        if errors is not None and not self._bare:
            smooth = unknown[next(iter(unknown))]
            nuisances = _with_likely_fraction(nuisances, factor, linear.residual, linear.typical_noise * smooth)
        return Base(
            self.states,
            self.prior,
            first,
            state,
            linear.at,
            linear.effects,
            linear.known,
            nuisances,
            unknown,
            GaussianModel(factor, nuisances.columns),
            linear.noise,
            linear.points,
            linear.residual,
            errors,
            tuple(self._remarks),
        )

    def _freed(self, rough: _Linear) -> Hypothesis:
        """Tissue and field beside any smooth force; recordings are realigned."""
        nuisances = rough.nuisances
        # before points of a surface are compared with the right faces a registration may be wrong by more than it is
        part, wider = nuisances.part("registration"), belief("registration.rough")
        loose = np.column_stack([nuisances.columns, rough.anything, wider * nuisances.columns[:, part]])
        model = GaussianModel(rough.noise_factor, loose)
        values, log_prior = scales()
        model = model.with_scale(model.likely_scale(rough.residual, values, log_prior))
        inflation = with_gross_errors(model, rough.residual, rough.points, outliers()).inflation
        model = model.with_columns(columns_of_inflation(model, rough.points, inflation))
        xi, _ = model.coefficients(rough.residual)
        turned = loose.shape[1]
        self.states.realign((xi[part] + wider * xi[turned - 6 : turned]) * registration_sd())
        farthest = belief("tissue.farthest_base")
        tissue = np.clip(xi[nuisances.part("tissue")], -farthest, farthest)
        field = np.clip(xi[nuisances.part("stiffness field")], -farthest, farthest)
        return Hypothesis(self.prior.mean + self.prior.factor @ tissue, field)

    def _declared(self) -> Hypothesis:
        field = np.zeros(self.states.modes.shape[1])
        try:
            theta = declared(self.states.case, self.states.parameters)
        except InputError:
            theta = self.prior.mean.copy()
        return Hypothesis(theta, field)

    def _errors_of_mesh(self, state: SolvedState) -> MeshErrors | None:
        if not self._mesh_error:
            return None
        try:
            return FinerStates(self.states).errors(state, other_volume(self.states), self.prior)
        except (SolveError, InputError) as error:
            self._remarks.append(f"the error of the mesh is not known: {error}")
            return None


class _Linear:
    """What is linear about a state: nuisances, residual, noise."""

    def __init__(self, finder: BaseFinder, state: SolvedState, errors: MeshErrors | None) -> None:
        sensors, states = state.sensors, finder.states
        self.at = Linearisation(state.system, state.u, state.reactions, sensors)
        self.known: dict[str, SolvedState] = {}
        self.effects = Effects(self.at, Solving(states, state, sensors, self.known), errors)
        # which makes the compliance: with it nuisances are products, where each would have an equilibrium of its own
        self.lengths = (finder._spacing * beliefs("unknown.lengths")).tolist()
        self.body_forces = body_forces(self.at, self.lengths)
        smooth = np.column_stack(self.body_forces)
        nuisances = nuisances_at(self.at, states, state.hypothesis.theta, finder.prior, self.effects, errors)
        self.nuisances = nuisances.weakened() if finder._bare else nuisances
        # what the state has of tissue and field is given back, so that their middle is that of their prior
        self._finder = finder
        self.residual = self._without(state)
        rows = sensors.is_displacement
        size = float(np.sqrt(np.mean(self.residual[rows] ** 2))) if rows.any() else 1.0
        #: Columns of smooth forces as large as the residuals.
        self.anything = size * smooth
        self.noise = noise_of(sensors, self.residual, self.nuisances.columns, smooth)
        self.noise_factor = noise_factor(sensors.positions, sensors.directions, sensors.times, self.noise)
        self.typical_noise = float(np.median(self.noise[rows] if rows.any() else self.noise))
        self.points = tuple(rows for alike in rows_of_points(sensors) for rows in alike)

    def _without(self, state: SolvedState) -> Floats:
        """What is recorded less what a state has, its tissue, field and motion given back."""
        z = self.nuisances.coordinates(self._finder.prior, state.hypothesis)
        z[self.nuisances.part("registration")] = self._finder.states.motion / registration_sd()
        return np.asarray(state.sensors.residual + self.nuisances.columns @ z)

    def moved(self, state: SolvedState) -> _Linear:
        """The same columns with the residuals of a state nearby: a compliance takes as long as many states."""
        other = copy.copy(self)
        other.residual = self._without(state)
        return other


def _with_likely_fraction(nuisances: Nuisances, factor: Floats, residual: Floats, smooth: Floats) -> Nuisances:
    """Nuisances with the root mean square of what the unknown part of the mesh's error is after the residuals.

    It depends on mesh, load and where is recorded; taken for larger than it is, it hides what is missing. It is weighed
    with and without any smooth force beside it: what is missing must not be taken for an error of the mesh.

    Parameters
    ----------
    nuisances : Nuisances
    factor : (n, n) array
        Of the noise.
    residual : (n,) array
    smooth : (n, k) array
        Columns of a smooth force as large as the noise.
    """
    from scipy.special import logsumexp, softmax

    fractions = beliefs("mesh.unknown")
    values, log_prior = scales()
    scores = []
    for fraction in fractions.tolist():
        model = GaussianModel(factor, nuisances.with_fraction(fraction).columns)
        each = [model, *(model.with_columns(size * smooth) for size in beliefs("unknown.sizes")[1:-1].tolist())]
        logs = [one.log_marginal(residual, values, log_prior) for one in each]
        scores.append(logsumexp([logs[0], logsumexp(logs[1:]) - np.log(len(logs) - 1)]))
    return nuisances.with_fraction(float(np.sqrt(softmax(scores) @ fractions**2)))
