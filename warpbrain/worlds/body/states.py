"""States of a case under hypotheses: other tissue, a stiffness field, further mechanisms."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.boundary import Boundary, Fixed
from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments, goes_on, recorded_times
from warpbrain.errors import SolveError
from warpbrain.estimation.finer_mesh import Difference
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.registration import realigned, registration_of
from warpbrain.mesh import TetMesh
from warpbrain.mesh.quality import extent
from warpbrain.physics.composition import CompositionError
from warpbrain.physics.mechanism import Following, Mechanism
from warpbrain.physics.proposal import Patch
from warpbrain.simulation.equilibrium import Equilibrium, EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.factors import KeptFactors
from warpbrain.simulation.locking import elements_of_fits
from warpbrain.simulation.model import Material, all_substituted
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.quasi_static import follow_slowly
from warpbrain.simulation.system import System
from warpbrain.threads import beside
from warpbrain.worlds.body.consolidation import bound_term, consolidation
from warpbrain.worlds.body.creep import Creep
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.sensors import Sensors
from warpbrain.worlds.body.stiffness_field import FieldSizes, StiffnessField, stiffness_modes
from warpbrain.worlds.body.surfaces import with_free_surfaces

#: Out-of-balance force of an equilibrium, relative.
TOLERANCE = 1e-6
#: Short steps after a load has come, as parts of the first time that counts.
_SHORT = (1e-3, 0.1, 0.4)
#: Shortest step along the path from a known state: the step of a fit whose trial needs shorter ones is too bold.
_SHORTEST = 1.0 / 16.0


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Tissue, stiffness field and mechanisms that a state is computed with."""

    theta: Floats  # (p,), of the tissues; see `Parameters`
    field: Floats  # (k,), of the modes of the stiffness field, in standard deviations
    mechanisms: tuple[Mechanism, ...] = ()  # beside those of the case
    patches: tuple[Patch, ...] = ()  # nodes that the case's boundaries no longer hold


@dataclass(frozen=True, eq=False)
class Instant:
    """An equilibrium at a time [s]: its system, displacement [m] and reactions [N], (N, 3)."""

    time: float
    system: System
    u: Floats
    reactions: Floats


@dataclass(frozen=True, eq=False)
class SolvedState:
    """An equilibrium under a hypothesis."""

    hypothesis: Hypothesis
    system: System
    u: Floats  # (N, 3)
    reactions: Floats  # (N, 3)
    #: At that state, corrected by the expected error of the mesh: with walls where elements that are too stiff leave
    #: them a point in a narrow ventricle would be taken for one of the opposite wall.
    sensors: Sensors
    #: (N, 3): displacement [m] at each of `steps_to` where it was followed over time; empty where it was not.
    course: tuple[Floats, ...] = ()
    #: The state at each of the times, of which `system`, `u` and `reactions` are the last.
    instants: tuple[Instant, ...] = ()
    #: Where tissue relaxes, or fluid flows, on the way to that state.
    creep: Creep | None = None

    def linearised(self, sensors: Sensors | None = None) -> Linearisation:
        """The linear model about the state; of its own sensors unless given.

        A state that was followed over time is linear about its end, as if nothing relaxed any more (`Creep`).

        `SolveError` if it is unstable.
        """
        sensors = self.sensors if sensors is None else sensors
        last = Linearisation(self.system, self.u, self.reactions, sensors)
        if self.creep is not None:
            last = last.after(self.creep)
        systems = {id(instant.system) for instant in self.instants}
        if sensors.is_counted_from_rest and (self.course or len(systems) <= 1):
            return last
        made = {id(self.system): last}
        for instant in self.instants:
            if id(instant.system) not in made:
                made[id(instant.system)] = Linearisation(instant.system, instant.u, instant.reactions, sensors)
        return last.in_time([(each.time, made[id(each.system)], _projection(each.u, self.u)) for each in self.instants])


class States:
    """Solves a case under hypotheses.

    `role` {"fit", "check"}: of the recordings that states are compared with. `times`: those of rows and of what they
    are counted from [s], increasing; infinity alone if there is one state. `motion` (6,): rigid motion that recordings
    are taken to have been moved by.
    """

    def __init__(self, case: Case, device: str | None = None, role: str = "fit") -> None:
        self.case = case = with_free_surfaces(case)
        self.field_sizes = FieldSizes.of(case.heterogeneity)
        mesh, sd = case.remaining[0], self.field_sizes.of_modes
        # in a thread, while recordings are located and mechanisms proposed
        self._modes = beside(lambda: stiffness_modes(mesh, sd))
        self.device = device
        self.parameters = Parameters.of(case)
        self.times = times_of_states(case, role)
        self.motion = np.zeros(6)
        self._role = role
        # every time has a state of its own, even where it is the same one
        self._each = Moments(self.times, (case,), tuple(range(len(self.times))))
        # where the equilibrium of each time was found last
        self._near: dict[float, Floats] = {}
        self.observations = self._observations_of(case)
        self.centre = self.observations.centre
        self.solves = 0
        self._factors: dict[tuple[str, ...], KeptFactors] = {}

    @cached_property
    def modes(self) -> Floats:
        """Of the stiffness field: what a standard deviation of each adds to `ln mu` of elements (m, k)."""
        return self._modes()

    def realign(self, motion: Floats) -> None:
        """Move recordings back by a rigid motion (6,); see `realigned`."""
        self.motion = motion
        self.observations = self._observations_of(realigned(self.case, motion, self.centre))

    def _observations_of(self, case: Case) -> Observations:
        return (Observations.to_fit if self._role == "fit" else Observations.to_check)(case, self._each)

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
        known: Floats | None = None,
        in_the_end: bool = False,
    ) -> SolvedState:
        """The equilibrium under a hypothesis.

        `start` (N, 3): a displacement [m] that is near to it. `expected`: error of the mesh, by which the sensors are
        corrected. `course`: of a state that is near to it, if it is followed over time. `iterations`: of Newton's
        method in all, after which there is taken to be none. `nearby`: of a state that is near to it. `known` (N, 3): a
        state [m] on whose branch it is to be, see `_equilibrium`. `in_the_end`: when nothing relaxes or flows any more,
        whatever was recorded before. `InputError` if a law is not stable, `SolveError` if
        there is none.
        """
        system = self._system(hypothesis)
        flowing = self._flowing(hypothesis, system)
        if flowing is not None and not in_the_end:
            others = tuple(mechanism for mechanism in hypothesis.mechanisms if mechanism is not flowing)
            end = self.solve(replace(hypothesis, mechanisms=others), start, expected, (), iterations, nearby, known)
            return _on_the_way(end, hypothesis, flowing)
        self.solves += 1
        # relaxing stress or a fluid of the case's own: no other memory of a term changes a state in time
        in_time = any(term.forgets_in is not None or term.coupling is not None for term in system.terms)
        options = EquilibriumOptions(tolerance=TOLERANCE, max_total_newton=iterations)
        taken: tuple[Floats, ...] = ()
        creep: Creep | None = None
        if in_time and not in_the_end and np.isfinite(self.times).all():
            starts, factors = course or (() if start is None else (start,)), self._factors_of(system)
            moments = follow_slowly(system, steps_to(self.times), options, near=starts, factors=factors)
            by_time = {moment.time: moment.state for moment in moments}
            taken = tuple(state.u for state in by_time.values())
            instants = [
                self._instant(time, system, by_time[time], system.model.external_forces(time)) for time in self.times
            ]
            creep = self._creep(instants, options)
        else:
            instants = self._at_rest(hypothesis, system, start, options, nearby, known)
        sensors = self._sensors(instants, creep, expected)
        last = instants[-1]
        return SolvedState(hypothesis, last.system, last.u, last.reactions, sensors, taken, tuple(instants), creep)

    def _creep(self, instants: Sequence[Instant], options: EquilibriumOptions) -> Creep:
        """On the way to the last instant; from then on its system is in equilibrium, and has no memory."""
        last = end = instants[-1]
        external = last.system.model.external_forces()
        try:
            end = self._instant(
                np.inf, last.system, self._equilibrium(last.system, external, last.u, options, None), external
            )
        except SolveError:
            # what still relaxes keeps it from collapse: then the last instant is all that is known
            last.system.set_time_step(np.inf)
            last.system.forget()
        by_loads, of_reactions = _parts(instants, end)
        return Creep(by_loads, _parts(instants, last)[0], of_reactions)

    def _at_rest(
        self,
        hypothesis: Hypothesis,
        system: System,
        start: Floats | None,
        options: EquilibriumOptions,
        nearby: Linearisation | None,
        known: Floats | None,
    ) -> list[Instant]:
        """The equilibrium at each time, under what acts then."""
        case = self.case_of(hypothesis)
        moments = Moments.of(case, self.times)
        instants: dict[int, Instant] = {}
        # the last first: it is what others begin at
        for time, number in sorted(zip(moments.times, moments.numbers, strict=True), reverse=True):
            if number in instants:
                continue
            system_then = system if moments.cases[number] is case else self._system(hypothesis, moments.cases[number])
            external, first = system_then.model.external_forces(), not instants
            near = start if first else self._near.get(time, start)
            if nearby is not None and near is not None and first:
                near = nearby.toward_equilibrium(system_then, external, near, TOLERANCE)
            try:
                state = self._equilibrium(system_then, external, near, options, known if first else None)
            except SolveError:
                if first or near is None:
                    raise
                state = self._equilibrium(system_then, external, None, options, None)
            instants[number] = self._instant(time, system_then, state, external)
            if len(moments.cases) > 1:
                self._near[time] = state.u
        return [
            replace(instants[number], time=time) for time, number in zip(moments.times, moments.numbers, strict=True)
        ]

    def _equilibrium(
        self, system: System, external: Floats, start: Floats | None, options: EquilibriumOptions, known: Floats | None
    ) -> Equilibrium:
        """The equilibrium under nodal forces (N, 3) [N]; beside a known state (N, 3) [m] the stable one on its branch.

        Where several are stable, or none is, iterations that go downhill end in one of them, or nowhere, as they are
        rounded. So they are given up where a tangent is not positive definite, or steps do not contract, for the path
        from the known state; where that turns or branches there is no such state. What is found does not depend on how
        many iterations are allowed: where rounding decides that one more is taken it would be all or nothing. Where
        something opens and closes steps need not contract: they do not where it does, though nothing branches.
        """
        factors = self._factors_of(system)
        if known is None:
            return EquilibriumSolver(system, options, factors=factors).solve(external, start)
        most = round(options.max_newton / _SHORTEST)
        smooth = all(term.is_smooth for term in system.terms)
        stable = replace(options, pass_unstable=False, contracts=smooth, max_total_newton=most)
        try:
            at_once = replace(stable, min_load_step=1.0)
            return EquilibriumSolver(system, at_once, factors=factors).solve(external, start)
        except SolveError:
            along = replace(stable, min_load_step=_SHORTEST)
            return EquilibriumSolver(system, along, factors=factors).solve(external, known)

    def _flowing(self, hypothesis: Hypothesis, system: System) -> Mechanism | None:
        """The mechanism of a hypothesis whose fluid flows while recordings are made.

        None where the course to one end does not say it all: stress relaxes, too, loads change, or recordings are
        counted from another state than rest.
        """
        followed = np.isfinite(self.times).all() and all(term.forgets_in is None for term in system.terms)
        if not followed or all(term.coupling is None for term in system.terms):
            return None
        counted_from_rest = all(getattr(each, "reference", None) is None for each in self.case.recordings)
        if not counted_from_rest or len(Moments.of(self.case_of(hypothesis), self.times).cases) > 1:
            return None
        following = (m for m in hypothesis.mechanisms if isinstance(m, Following))
        return next((m for m in following if bound_term(system, m).coupling is not None), None)

    @staticmethod
    def _instant(time: float, system: System, state: Equilibrium, external: Floats) -> Instant:
        # tissue that is stretched without end resists no more, which balances any load that follows it
        if not np.linalg.norm(state.u, axis=1).max(initial=0.0) < extent(system.model.mesh.points):
            raise SolveError("the body would move by more than its size")
        return Instant(time, system, state.u, system.model.reactions(state.internal, external))

    def corrected(self, state: SolvedState, expected: Difference | None) -> SolvedState:
        """A state with sensors where it is without the error of the mesh."""
        return replace(state, sensors=self._sensors(state.instants, state.creep, expected))

    def _sensors(self, instants: Sequence[Instant], creep: Creep | None, expected: Difference | None) -> Sensors:
        u, reactions = (np.array([getattr(instant, name) for instant in instants]) for name in ("u", "reactions"))
        parts = _parts(instants, instants[-1]) if creep is None else (creep.by_loads, creep.of_reactions)
        if expected is not None:
            # known for the end; earlier in proportion to the state
            of_u, of_reactions = (part[:, None, None] for part in parts)
            u, reactions = u + of_u * expected.u, reactions + of_reactions * expected.reactions
        sensors = self.observations.at(np.concatenate(u), np.concatenate(reactions), self.centre)
        of_rows = (part[sensors.after] - np.where(sensors.before < 0, 0.0, part[sensors.before]) for part in parts)
        share = np.where(sensors.is_displacement, *of_rows)
        sensors = replace(sensors, share=share)
        return sensors if expected is None else sensors.with_change(share * sensors.answer_within(expected.surplus))

    def _factors_of(self, system: System) -> KeptFactors:
        """Kept while the same mechanisms act: a fit has many states of those, one after the other."""
        acting = tuple(type(mechanism).__name__ for mechanism in system.model.mechanisms)
        if acting not in self._factors:
            self._factors = {acting: KeptFactors()}
        return self._factors[acting]

    def _system(self, hypothesis: Hypothesis, case: Case | None = None) -> System:
        """Of a hypothesis; `case`: at one time."""
        try:
            model = model_of(self.case_of(hypothesis) if case is None else case)
        except CompositionError as error:
            # treated like loads without an equilibrium
            raise SolveError(str(error)) from None
        model = replace(model, elements=elements_of_fits(self.case.poisson))
        if hypothesis.field.any():
            field = StiffnessField(log_factor=self.modes @ hypothesis.field)
            model = replace(model, mechanisms=(*model.mechanisms, field))
        return System(model, self.device)


def _on_the_way(end: SolvedState, hypothesis: Hypothesis, flowing: Mechanism) -> SolvedState:
    """The state of a hypothesis whose fluid flows, from its drained end state: sensors are linear about that.

    Step by step it takes minutes, and a fit has a hundred states. What is recorded before the end is 4 to 8 % off.
    """
    change = consolidation(end.linearised(), cast(Following, flowing)).at(1.0)
    sensors = end.sensors.with_change(change)
    rows = [sensors.is_displacement & (sensors.after == number) for number in range(len(end.instants))]
    of_u = np.array([_projection(sensors.computed[of_time], end.sensors.computed[of_time]) for of_time in rows])
    return replace(end, hypothesis=hypothesis, sensors=sensors, creep=Creep(of_u, of_u, np.ones(len(of_u))))


def _parts(instants: Sequence[Instant], end: Instant) -> tuple[Floats, Floats]:
    """Of displacement and reactions at the end that there are at each instant (t,)."""
    of_u = np.array([_projection(each.u, end.u) for each in instants])
    return of_u, np.array([_projection(each.reactions, end.reactions) for each in instants])


def _projection(field: Floats, whole: Floats) -> float:
    """Coefficient of the projection of a field on another one of its shape."""
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


def times_of_states(case: Case, role: str = "fit") -> tuple[float, ...]:
    """Times [s] of the states that recordings of a role are compared with.

    Infinity alone, for the end, where what is fitted has one state: of one time, with loads that stay after it. Where
    stress relaxes or fluid flows as the case says, there is nothing but the end either if loads change, or something
    was recorded at the end and at no time.
    """
    times = recorded_times(case, (role,))
    constant = len(Moments.of(case, (*times, np.inf)).cases) == 1
    # a cause that is found may change where nothing does that is declared: what is checked keeps its time
    if not times or (constant and len(times) < 2 and role == "fit"):
        return (np.inf,)
    if goes_on(case) and not (constant and np.isfinite(times).all()):
        return (np.inf,)
    return times


def instants_of(case: Case, times: Sequence[float]) -> int:
    """At how many times something is recorded under loads that came at once and stay: what flows or relaxes shows."""
    constant = len(Moments.of(case, (*times, np.inf)).cases) == 1
    return len(times) if constant and np.isfinite(times).all() else 1
