"""States of a case under hypotheses: other tissue, a stiffness field, further mechanisms."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.boundary import Boundary, Fixed
from warpbrain.cases.case import Case
from warpbrain.errors import SolveError
from warpbrain.estimation.finer_mesh import Difference
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.registration import realigned, registration_of
from warpbrain.mesh import TetMesh
from warpbrain.physics.composition import CompositionError
from warpbrain.physics.mechanism import Following, Mechanism
from warpbrain.physics.proposal import Patch
from warpbrain.simulation.assumed import all_substituted
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.keeping import kept_for
from warpbrain.simulation.kept_factors import KeptFactors
from warpbrain.simulation.locking import elements_of_fits
from warpbrain.simulation.model import Material
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.quasi_static import follow_slowly
from warpbrain.simulation.system import System
from warpbrain.worlds.body.consolidation import bound_term, consolidation
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.sensors import Sensors, sensors_at
from warpbrain.worlds.body.stiffness_field import StiffnessField, stiffness_modes
from warpbrain.worlds.body.surfaces import with_free_surfaces

#: Out-of-balance force of an equilibrium, relative.
TOLERANCE = 1e-6
#: Short steps after a load has come, as parts of the first time that counts.
_SHORT = (1e-3, 0.1, 0.4)


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Tissue, stiffness field and mechanisms that a state is computed with.

    Attributes
    ----------
    theta : (p,) array
        Of the tissues; see `Parameters`.
    field : (k,) array
        Of the modes of the stiffness field, in standard deviations.
    mechanisms : tuple of Mechanism
        Beside those of the case.
    patches : tuple of Patch
        Nodes that the case's boundaries no longer hold.
    """

    theta: Floats
    field: Floats
    mechanisms: tuple[Mechanism, ...] = ()
    patches: tuple[Patch, ...] = ()


@dataclass(frozen=True, eq=False)
class SolvedState:
    """An equilibrium under a hypothesis.

    Attributes
    ----------
    hypothesis : Hypothesis
    system : System
    u, reactions : (N, 3) array
    sensors : Sensors
        At that state, corrected by the expected error of the mesh: with walls where elements that are too stiff leave
        them a point in a narrow ventricle would be taken for one of the opposite wall.
    course : tuple of (N, 3) arrays
        Displacement [m] at each of `steps_to` where it was followed over time; empty where it was not.
    """

    hypothesis: Hypothesis
    system: System
    u: Floats
    reactions: Floats
    sensors: Sensors
    course: tuple[Floats, ...] = ()


class States:
    """Solves a case under hypotheses.

    Parameters
    ----------
    case : Case
    device : str, optional

    Attributes
    ----------
    times : tuple of float
        Recorded ones [s], increasing; infinity alone if no times were recorded, or they do not matter.
    motion : (6,) array
        Rigid motion that recordings are taken to have been moved by.
    solves : int
    """

    def __init__(self, case: Case, device: str | None = None) -> None:
        self.case = case = with_free_surfaces(case)
        self.device = device
        self.parameters = Parameters.of(case)
        self.times = recorded_times(case)
        self.motion = np.zeros(6)
        self.centre = Observations.to_fit(case).centre
        self.realign(self.motion)
        self.modes = stiffness_modes(case.remaining[0])
        self.solves = 0
        self._factors: dict[tuple[str, ...], KeptFactors | None] = {}

    def realign(self, motion: Floats) -> None:
        """Move recordings back by a rigid motion (6,); see `realigned`."""
        self.motion = motion
        case = realigned(self.case, motion, self.centre)
        self.observations = tuple(Observations.to_fit(case, None if np.isinf(time) else time) for time in self.times)

    @property
    def motion_coordinates(self) -> Floats:
        """That motion in standard deviations (6,) of the accuracy of the registration."""
        return self.motion / registration_of(self.case).deviations

    def case_of(self, hypothesis: Hypothesis) -> Case:
        """The case as a user would write it for a hypothesis, without the stiffness field."""
        applied = self.parameters.applied(self.case, hypothesis.theta)
        mesh, boundaries = _released(applied, hypothesis.patches)
        return replace(applied, mesh=mesh, boundaries=boundaries, mechanisms=self._acting(hypothesis))

    def _acting(self, hypothesis: Hypothesis) -> tuple[Mechanism, ...]:
        """Mechanisms of the case and of the hypothesis, which replace those of a kind of which a case has only one."""
        added = hypothesis.mechanisms
        replaced = {mechanism.kind for mechanism in added if not mechanism.several}
        kept = (mechanism for mechanism in self.case.mechanisms if mechanism.kind not in replaced)
        return (*kept, *added)

    def materials(self, hypothesis: Hypothesis) -> Mapping[int, Material]:
        """Those of a hypothesis, by label."""
        return all_substituted(self.parameters.materials(hypothesis.theta), self._acting(hypothesis))

    def solve(
        self,
        hypothesis: Hypothesis,
        start: Floats | None = None,
        expected: Difference | None = None,
        course: Sequence[Floats] = (),
        iterations: int = EquilibriumOptions.max_total_newton,
        nearby: Linearisation | None = None,
    ) -> SolvedState:
        """The equilibrium under a hypothesis.

        Parameters
        ----------
        hypothesis : Hypothesis
        start : (N, 3) array, optional
            A displacement [m] that is near to it.
        expected : Difference, optional
            Expected error of the mesh, by which the sensors are corrected.
        course : sequence of (N, 3) arrays, optional
            Of a state that is near to it, if it is followed over time.
        iterations : int
            Of Newton's method in all, after which there is taken to be none.
        nearby : Linearisation, optional
            Of a state that is near to it.

        Raises
        ------
        InputError
            If a law is not stable.
        SolveError
            If there is none.
        """
        system = self._system(hypothesis)
        flowing = self._flowing(hypothesis, system)
        if flowing is not None:
            return self._drained(hypothesis, flowing, start, expected, iterations, nearby)
        self.solves += 1
        model, external = system.model, system.model.external_forces()
        options = EquilibriumOptions(tolerance=TOLERANCE, max_total_newton=iterations)
        # relaxing stress or a fluid of the case's own: no other memory of a term changes a state in time
        in_time = any(term.forgets_in is not None or term.coupling is not None for term in system.terms)
        if in_time and np.isfinite(self.times[0]):
            starts, factors = course or (() if start is None else (start,)), self._factors_of(system)
            moments = follow_slowly(system, steps_to(self.times), options, near=starts, factors=factors)
            by_time = {moment.time: moment.state for moment in moments}
            course = tuple(state.u for state in by_time.values())
            states = [by_time[time] for time in self.times]
        else:
            course = ()
            # on a CPU conjugate gradients solve a single state in the time that factors take
            factors = None if system.device.is_cpu else self._factors_of(system)
            if nearby is not None and start is not None:
                start = nearby.toward_equilibrium(system, external, start, TOLERANCE)
            solver = EquilibriumSolver(system, options, factors=factors)
            states = [solver.solve(external, start)] * len(self.times)
        reactions = [model.reactions(state.internal, external) for state in states]
        sensors = self._sensors([(state.u, R) for state, R in zip(states, reactions, strict=True)], expected)
        return SolvedState(hypothesis, system, states[-1].u, reactions[-1], sensors, tuple(course))

    def _flowing(self, hypothesis: Hypothesis, system: System) -> Mechanism | None:
        """The mechanism of a hypothesis whose fluid flows while recordings are made, where no stress relaxes, too."""
        followed = np.isfinite(self.times[0]) and all(term.forgets_in is None for term in system.terms)
        if not followed or all(term.coupling is None for term in system.terms):
            return None
        bound = ((m, bound_term(system, m)) for m in hypothesis.mechanisms if isinstance(m, Following))
        return next((cast(Mechanism, m) for m, term in bound if term.coupling is not None), None)

    def _drained(
        self,
        hypothesis: Hypothesis,
        flowing: Mechanism,
        start: Floats | None,
        expected: Difference | None,
        iterations: int,
        nearby: Linearisation | None,
    ) -> SolvedState:
        """The state in the end, and sensors on the way to it, linear about it.

        Step by step it takes minutes, and a fit has a hundred states. What is recorded on the way is 4 to 8 % off.
        """
        others = tuple(mechanism for mechanism in hypothesis.mechanisms if mechanism is not flowing)
        end = self.solve(replace(hypothesis, mechanisms=others), start, expected, (), iterations, nearby)
        at = Linearisation(end.system, end.u, end.reactions, end.sensors)
        change = consolidation(at, bound_term(end.system, cast(Following, flowing))).at(1.0)
        sensors = replace(end.sensors, residual=end.sensors.residual - change, computed=end.sensors.computed + change)
        return replace(end, hypothesis=hypothesis, sensors=sensors)

    def corrected(self, state: SolvedState, expected: Difference) -> SolvedState:
        """A state that does not change in time, with sensors where it is without the error of the mesh."""
        return replace(state, sensors=self._sensors([(state.u, state.reactions)] * len(self.times), expected))

    def _sensors(self, moments: Sequence[tuple[Floats, Floats]], expected: Difference | None) -> Sensors:
        if expected is not None:
            # known for the end; earlier in proportion to the state
            u_end, reactions_end = moments[-1]
            moments = [
                (
                    u + _projection(u, u_end) * expected.u,
                    reactions + _projection(reactions, reactions_end) * expected.reactions,
                )
                for u, reactions in moments
            ]
        parts = zip(self.times, self.observations, moments, strict=True)
        return sensors_at([(time, observations, *moment) for time, observations, moment in parts], self.centre)

    def _factors_of(self, system: System) -> KeptFactors | None:
        """Kept while the same mechanisms act: a fit has many states of those, one after the other.

        On a GPU whatever acts: there an inverse is made anew as soon as it helps less.
        """
        same = system.model.mechanisms if system.device.is_cpu else ()
        acting = tuple(type(mechanism).__name__ for mechanism in same)
        if acting not in self._factors:
            self._factors = {acting: kept_for(system.device)}
        return self._factors[acting]

    def _system(self, hypothesis: Hypothesis) -> System:
        try:
            model, _ = model_of(self.case_of(hypothesis))
        except CompositionError as error:
            # treated like loads without an equilibrium
            raise SolveError(str(error)) from None
        model = replace(model, elements=elements_of_fits(self.case.poisson))
        if hypothesis.field.any():
            field = StiffnessField(log_factor=self.modes @ hypothesis.field)
            model = replace(model, mechanisms=(*model.mechanisms, field))
        return System(model, self.device)


def _projection(field: Floats, whole: Floats) -> float:
    """Coefficient of the projection of a field (N, 3) on another one."""
    square = float(np.vdot(whole, whole))
    return float(np.vdot(field, whole)) / square if square > 0.0 else 1.0


def steps_to(times: Sequence[float]) -> list[float]:
    """Times [s] of the steps from rest to the last recorded one: short ones after the load, longer ones later."""
    steps = [times[0] * part for part in _SHORT]
    for before, after in itertools.pairwise((0.0, *times)):
        steps += [before + part * (after - before) for part in (() if before == 0.0 else (0.3, 0.6))]
        # exactly the number by which states are looked up, not a sum that rounds differently
        steps.append(after)
    return steps


def _released(case: Case, patches: tuple[Patch, ...]) -> tuple[TetMesh, tuple[Boundary, ...]]:
    """Mesh and boundaries of a case that no longer holds some nodes, which become node sets."""
    if not patches:
        return case.mesh, case.boundaries
    nodes = case.remaining[1]
    sets = dict(case.mesh.node_sets)
    loose = np.zeros(len(case.mesh.points), dtype=bool)
    for patch in patches:
        sets[patch.name] = np.zeros(len(loose), dtype=bool)
        sets[patch.name][nodes] = patch.members
        loose |= sets[patch.name]
    boundaries = []
    for boundary in case.boundaries:
        if not isinstance(boundary, Fixed) or not (sets[boundary.nodes] & loose).any():
            boundaries.append(boundary)
            continue
        still = f"{boundary.nodes}-still-held"
        sets[still] = sets[boundary.nodes] & ~loose
        if sets[still].any():
            boundaries.append(replace(boundary, nodes=still))
    return case.mesh.with_node_sets(sets), tuple(boundaries)


def recorded_times(case: Case) -> tuple[float, ...]:
    """Times [s] at which all that a case is fitted to was recorded, under loads that no longer change.

    Infinity alone, for the end, where there is one time or none, or where loads or motions change after the first.
    """
    fitted = [recording for recording in case.recordings if recording.role == "fit"]
    series: list[set[float]] = []
    for recording in fitted:
        times = getattr(recording, "time", None)
        series.append(set() if times is None else set(np.unique(times).tolist()))
    common = sorted(set.intersection(*series)) if series else []
    if len(common) < 2 or common[0] <= 0.0:
        return (np.inf,)
    ramps = [ramp for acting in (*case.boundaries, *case.mechanisms) if (ramp := getattr(acting, "ramp", ()))]
    changing = any(ramp[-1][0] > common[0] for ramp in ramps)
    moving = any(getattr(boundary, "has_history", False) for boundary in case.boundaries)
    return (np.inf,) if changing or moving else tuple(common)
