"""The state that everything is compared at: the case as declared, its tissue refitted beside any smooth force.

Nuisances fitted as if nothing were missing imitate what is missing; fitted beside a force that may be anything they do
not. Where the load is large one round from the declared state is not enough: columns there are off by a third.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.diagnosis.flexible import LENGTHS, flexible_columns, smooth_forces
from warpbrain.diagnosis.fraction import likely_fraction
from warpbrain.diagnosis.gross_errors import ASIDE, gross_errors
from warpbrain.diagnosis.pairs import PairEvidence, Pairs, pairs_at
from warpbrain.diagnosis.sensing import explanation_of, known_sigma
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.simulation.locking import on_linear_elements
from warpbrain.threads import beside
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.mesh_error import FinerStates, MeshErrors, expected
from warpbrain.worlds.body.nuisances import Nuisances, nuisances_at, other_volume, registration_sd
from warpbrain.worlds.body.sensors import Sensors, tracked_points
from warpbrain.worlds.body.states import Hypothesis, SolvedState, States
from warpbrain.worlds.body.switching import Known, Solving
from warpbrain.worlds.body.time_courses import main_courses
from warpbrain.worlds.body.tissue_prior import declared, tissue_prior
from warpbrain.worlds.listener import Listener

Floats = NDArray[np.float64]

#: How much larger an error of registration may be in the first round.
_ROUGHLY = 5.0
#: How often an undeclared noise is found anew without the gross errors that it shows.
_NOISE_ROUNDS = 3
#: How far tissue and field may go from the middle of their prior [standard deviations].
_FARTHEST = 1.5
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
    known : Known
        What was solved beside the base for them.
    nuisances : Nuisances
    flexible : tuple of (n, k) arrays
        Columns of smooth forces of each length, of 1 m.
    pairs : Pairs
        Of places that draw each other.
    sigma : (n,) array
        Noise of each row, very large where a row is set aside.
    noise : (n,) array
        The same without that.
    aside : (n,) bool array
        Gross errors.
    explanation : Explanation
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
    known: Known
    nuisances: Nuisances
    flexible: tuple[Floats, ...]
    pairs: Pairs
    sigma: Floats
    noise: Floats
    aside: NDArray[np.bool_]
    explanation: Explanation
    residual: Floats
    mesh_errors: MeshErrors | None
    remarks: tuple[str, ...]

    @property
    def whitened(self) -> Floats:
        """The residual, whitened by the noise."""
        return self.explanation.whitened(self.residual)

    @property
    def typical_noise(self) -> float:
        """Median of the noise of displacements [m]."""
        return _typical(self.noise, self.at.sensors)

    @property
    def constant_forces(self) -> list[Floats]:
        """Columns of smooth forces of each length and size that are always there."""
        return smooth_forces(self.flexible, self.typical_noise)

    def pair_evidence(self, explanation: Explanation) -> PairEvidence:
        """Of two places that draw each other, beside an explanation."""
        return PairEvidence(explanation, self.pairs, self.typical_noise)

    @property
    def smooth_forces(self) -> list[Floats]:
        """The same of each course in time."""
        times = self.at.sensors.times
        factors = [course.factor(times)[:, None] for course in main_courses(self.states.times)]
        return [factor * columns for columns in self.constant_forces for factor in factors]

    def without(self, rows: NDArray[np.bool_]) -> Base:
        """The same with more rows (n,) set aside as gross errors."""
        return self._with_aside(self.aside | rows)

    def with_back(self, rows: NDArray[np.bool_]) -> Base:
        """The same without some of the rows (n,) that are set aside."""
        return self._with_aside(self.aside & ~rows)

    def _with_aside(self, aside: NDArray[np.bool_]) -> Base:
        if np.array_equal(aside, self.aside):
            return self
        sigma = np.where(aside, ASIDE * self.noise, self.noise)
        explanation = explanation_of(self.at.sensors, sigma, self.nuisances.columns)
        return replace(self, sigma=sigma, aside=aside, explanation=explanation)

    def elsewhere(self, points: Floats) -> tuple[Nuisances, Effects]:
        """What nuisances do to the displacement of other points (k, 3) [m], and what makes effects there."""
        return self.seen_by(tracked_points(self.at.system.model.mesh, points, self.states.centre))

    def seen_by(self, sensors: Sensors) -> tuple[Nuisances, Effects]:
        """What nuisances do to other sensors, in the coordinates that they have here, and what makes effects there."""
        at = self.at.with_sensors(sensors)
        effects = Effects(at, Solving(self.states, self.state, at.sensors, self.known), self.mesh_errors)
        theta = self.state.hypothesis.theta
        own = self.nuisances
        return nuisances_at(
            at, self.states, theta, self.prior, effects, self.mesh_errors, own.anchors, own.fraction
        ), effects


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
    """

    def __init__(
        self, states: States, spacing: float, mesh_error: bool, without_nuisances: bool, listener: Listener
    ) -> None:
        self.states = states
        # a second of drawing from the generative model, while the first state is solved
        self._prior = beside(lambda: tissue_prior(states.case, states.parameters))
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
        state = first
        for _ in range(_ROUNDS):
            rough = self._linearised(first, state, None)
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
        self._listener.stage("the error of the mesh, and the compliance of the body at the sensors")
        errors = self._errors_of_mesh(state)
        if errors is not None:
            state = self.states.corrected(state, expected(errors.own))
        return self._linearised(first, state, errors)

    def moved(self, base: Base, fit: SolvedState, errors: MeshErrors | None) -> Base:
        """The same at another state: one that a fit has found far from the base, where all that is linear is wrong.

        Parameters
        ----------
        base : Base
        fit : SolvedState
        errors : MeshErrors or None
            There.
        """
        return self._linearised(base.declared, fit, errors)

    def _freed(self, rough: Base) -> Hypothesis:
        """Tissue and field beside any smooth force; recordings are realigned."""
        explanation = rough.explanation.with_more(_any_force(rough.flexible, rough.residual, rough.at))
        # before points of a surface are compared with the right faces a registration may be wrong by more than it is
        registration = rough.nuisances.part("registration")
        explanation = explanation.with_more(_ROUGHLY * rough.nuisances.columns[:, registration])
        kappa = explanation.best_kappa(rough.whitened)
        xi = explanation.nuisances_given(rough.whitened, kappa)
        self.states.realign((xi[registration] + _ROUGHLY * xi[-6:]) * registration_sd())
        return self._moved(rough.nuisances, xi)

    def _declared(self) -> Hypothesis:
        field = np.zeros(self.states.modes.shape[1])
        try:
            theta = declared(self.states.case, self.states.parameters)
        except InputError:
            theta = self.prior.mean.copy()
        return Hypothesis(theta, field)

    def _moved(self, nuisances: Nuisances, xi: Floats) -> Hypothesis:
        tissue = np.clip(xi[nuisances.part("tissue")], -_FARTHEST, _FARTHEST)
        field = np.clip(xi[nuisances.part("stiffness field")], -_FARTHEST, _FARTHEST)
        return Hypothesis(self.prior.mean + self.prior.factor @ tissue, field)

    def _errors_of_mesh(self, state: SolvedState) -> MeshErrors | None:
        if not self._mesh_error:
            return None
        try:
            return FinerStates(self.states).errors(state, other_volume(self.states), self.prior)
        except (SolveError, InputError) as error:
            self._remarks.append(f"the error of the mesh is not known: {error}")
            return None

    def _linearised(self, first: SolvedState, state: SolvedState, errors: MeshErrors | None) -> Base:
        sensors = state.sensors
        at = Linearisation(state.system, state.u, state.reactions, sensors)
        known = Known()
        effects = Effects(at, Solving(self.states, state, sensors, known), errors)
        # which makes the compliance: with it nuisances are products, where each would have an equilibrium of its own
        flexible = flexible_columns(at, [length * self._spacing for length in LENGTHS])
        nuisances = nuisances_at(at, self.states, state.hypothesis.theta, self.prior, effects, errors)
        if self._bare:
            nuisances = nuisances.weakened()
        # what the state has of tissue and field is given back, so that their middle is that of their prior
        z = nuisances.coordinates(self.prior, state.hypothesis)
        z[nuisances.part("registration")] = self.states.motion / registration_sd()
        residual = sensors.residual + nuisances.columns @ z
        anything = _any_force(flexible, residual, at)
        loose = np.column_stack([nuisances.columns, anything])
        aside = np.zeros(len(sensors), dtype=bool)
        for _ in range(_NOISE_ROUNDS):
            noise = known_sigma(sensors, residual, nuisances.columns, np.column_stack(flexible), aside)
            looser = explanation_of(sensors, np.where(aside, ASIDE * noise, noise), loose)
            kappa = max(1.15, looser.best_kappa(looser.whitened(residual)))
            found = gross_errors(sensors, explanation_of(sensors, noise, loose), kappa, residual)
            if not np.any(found & ~aside) or not np.isnan(sensors.sigma).any():
                aside = found
                break
            aside = found
        sigma = np.where(aside, ASIDE * noise, noise)
        explanation = explanation_of(sensors, sigma, nuisances.columns)
        if errors is not None and not self._bare:
            smooth = smooth_forces(flexible, _typical(noise, sensors))
            nuisances = nuisances.with_fraction(likely_fraction(explanation.factor, nuisances, residual, smooth))
            explanation = Explanation(explanation.factor, nuisances.columns)
        return Base(
            self.states,
            self.prior,
            first,
            state,
            at,
            effects,
            known,
            nuisances,
            flexible,
            pairs_at(at, self._spacing),
            sigma,
            noise,
            aside,
            explanation,
            residual,
            errors,
            tuple(self._remarks),
        )


def _typical(noise: Floats, sensors: Sensors) -> float:
    """Median of the noise of displacements [m]."""
    return float(np.median(noise[sensors.is_displacement]))


def _any_force(flexible: tuple[Floats, ...], residual: Floats, at: Linearisation) -> Floats:
    """Columns of smooth forces as large as the residuals."""
    rows = at.sensors.is_displacement
    size = float(np.sqrt(np.mean(residual[rows] ** 2))) if rows.any() else 1.0
    return size * np.column_stack(flexible)
