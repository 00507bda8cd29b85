"""A case from what a user has to what is computed of it: what `warpbrain run` and `warpbrain.run` do.

From rest to the state that is asked for: an equilibrium, a motion, a motion to rest, slow change.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.cases.moments import Moments, recorded_times
from warpbrain.cases.shipped import as_case
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.recordings.recording import TestRecording
from warpbrain.shown import Shown
from warpbrain.simulation.dynamics import PhaseClock, Simulator
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver, NewtonStep
from warpbrain.simulation.locking import choose_elements
from warpbrain.simulation.model import Model, require_held
from warpbrain.simulation.observation import Observed, observe
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.quasi_static import follow_slowly, growing_times
from warpbrain.simulation.relaxation import RelaxationOptions, RelaxationStep, relax_to_rest
from warpbrain.simulation.result import NodalState, Result, nodal_state_of, result_of
from warpbrain.simulation.specimen import SpecimenRun, SpecimenRunning, not_transmitted, specimen_of
from warpbrain.simulation.system import System

#: Steps of slow change where nobody names a number.
SLOW_STEPS = 20


@dataclass(frozen=True)
class Course:
    """How far a case is followed, and how closely. Of the first three at most one, but `steps` may go with `until`.

    `InputError` if they mean nothing together, or a number makes no sense.
    """

    #: follow the motion for so many time steps of 1 ms; of slow change into how many it is divided
    steps: int | None = None
    to_rest: bool = False  # follow the damped motion until it is at rest
    until: float | None = None  # follow slow change without inertia until then [s]
    tolerance: float = 1e-8  # out-of-balance force in the end, relative to all nodal forces; see `EquilibriumOptions`
    #: of a motion to rest: how long steps are until its swing was seen [s]; None: they grow from 1 ms on
    time_step: float | None = None

    def __post_init__(self) -> None:
        if self.steps is not None and (not isinstance(self.steps, int) or self.steps < 1):
            raise InputError(f"steps = {self.steps!r}: expected a whole number of at least 1")
        if self.until is not None and not (math.isfinite(self.until) and self.until > 0.0):
            raise InputError(f"until = {self.until:g}: expected a positive number of seconds")
        if not 0.0 < self.tolerance < 1.0:
            raise InputError(f"tolerance = {self.tolerance:g}: expected a number between 0 and 1")
        if self.time_step is not None and not (math.isfinite(self.time_step) and self.time_step > 0.0):
            raise InputError(f"time_step = {self.time_step:g}: expected a positive number of seconds")
        if self.time_step is not None and not self.to_rest:
            raise InputError("time_step: means nothing without to_rest, whose swing it resolves")
        if self.to_rest and (self.steps is not None or self.until is not None):
            other = "steps" if self.until is None else "until"
            raise InputError(f"to_rest: means nothing with {other}: leave one of them out")


@dataclass(frozen=True)
class Watching:
    """Who wants to know how a simulation gets on."""

    newton: Callable[[NewtonStep], None] = lambda _step: None  # called with each Newton step to an equilibrium
    relaxation: Callable[[RelaxationStep], None] = lambda _step: None  # called with each step of a motion to rest
    #: called with the number of each step of a motion, and what is noted of it: nine of ten times nothing
    motion: Callable[[int, float, dict[str, Any] | None], None] = lambda _number, _time, _noted: None
    #: called with the part that is done of slow change, and each Newton step
    slow_newton: Callable[[float, NewtonStep], None] = lambda _part, _step: None
    #: called with the number of a moment of slow change, how many there will be, and what is noted of it
    slow: Callable[[int, int, dict[str, Any]], None] = lambda _number, _count, _noted: None


@dataclass(frozen=True)
class Followed:
    """What a course came to; the system has its last state."""

    #: for `summary.json`: what kind of state it is, how closely it was found, and the steps to it.
    solution: dict[str, Any]
    time: float | None  # of the state [s]; None of one at rest
    begun: float  # when the first step was done, of `time.perf_counter`
    seconds: Mapping[str, float]  # by phase
    calls: Mapping[str, int]  # by phase
    states: Mapping[float, NodalState] = field(default_factory=dict)  # earlier ones at which something was recorded


def _timed(watch: Callable[[Any], None]) -> tuple[list[float], Callable[[Any], None]]:
    """A list for the times of steps, and who notes them there and watches."""
    times: list[float] = []

    def on_step(step: Any) -> None:
        times.append(time.perf_counter())
        watch(step)

    return times, on_step


def _equilibrium(system: System, course: Course, watching: Watching) -> Followed:
    times, on_step = _timed(watching.newton)
    solver = EquilibriumSolver(system, EquilibriumOptions(tolerance=course.tolerance), on_step)
    state = solver.solve()
    solution = {
        "kind": "equilibrium",
        "tolerance": solver.tolerance,
        "relative_residual": state.residual,
        "stored_energy_J": state.energy,
        "iterations_with_indefinite_tangent": state.unstable_iterations,
        "history": [vars(step) for step in state.history],
    }
    return Followed(solution, None, (*times, time.perf_counter())[0], solver.clock.seconds, solver.clock.counts)


def _to_rest(system: System, course: Course, watching: Watching) -> Followed:
    times, on_step = _timed(watching.relaxation)
    clock = PhaseClock(system.device)
    options = RelaxationOptions(tolerance=course.tolerance)
    if course.time_step is not None:
        options = replace(options, time_step=course.time_step, swing=True)
    state = relax_to_rest(system, options, on_step, clock)
    swing = state.swing and {
        "frequency_Hz": state.swing.frequency,
        "damping": state.swing.damping,
        "damping_in_steps": state.swing.damping_in_steps,
        "time_step_s": state.swing.time_step,
    }
    solution = {
        "kind": "at rest",
        "tolerance": state.tolerance,
        "relative_residual": state.residual,
        **({"swing": swing} if options.swing else {}),
        "history": [vars(step) for step in state.history],
    }
    return Followed(solution, None, (*times, time.perf_counter())[0], clock.seconds, clock.counts)


def _motion(case: Case, system: System, steps: int, watching: Watching) -> Followed:
    simulator = Simulator(system)
    clock = PhaseClock(system.device)
    every = max(1, steps // 10)
    history: list[dict[str, Any]] = []
    recorded = recorded_times(case, ("fit", "check"))
    states: dict[float, NodalState] = {}
    begun = 0.0
    for step in range(1, steps + 1):
        min_J = simulator.step_to(step / steps, clock)
        begun = begun or time.perf_counter()
        # a recorded time is that of the step that ends nearest to it
        near = [at for at in recorded if abs(at - simulator.time) <= 0.5 * simulator.time_step and at not in states]
        if near:
            states |= dict.fromkeys(near, nodal_state_of(system, simulator.time))
        noted = None
        if step % every == 0 or step == steps:
            noted = {"time_s": simulator.time, "cg_iterations": simulator.last_solve().iterations, "min_J": min_J}
            noted["kinetic_J"] = simulator.kinetic_energy()
            history.append(noted)
        watching.motion(step, simulator.time, noted)
    solution = {
        "kind": "motion",
        "time_s": simulator.time,
        "time_step_s": simulator.time / steps,
        "damping": vars(system.model.damping),
        "cg_tolerance": simulator.tolerance,
        "history": history,
    }
    return Followed(solution, simulator.time, begun, clock.seconds, clock.counts, states)


def _slowly(case: Case, system: System, until: float, course: Course, watching: Watching) -> Followed:
    recorded = {at for at in recorded_times(case, ("fit", "check")) if at <= until}
    times = sorted({*growing_times(until, course.steps or SLOW_STEPS), *recorded})
    states: dict[float, NodalState] = {}
    clock = PhaseClock(system.device)
    taken: list[NewtonStep] = []
    history: list[dict[str, Any]] = []

    def watch(step: NewtonStep) -> None:
        taken.append(step)
        watching.slow_newton(len(history) / len(times), step)

    noted_at, on_step = _timed(watch)
    options = EquilibriumOptions(tolerance=course.tolerance)
    for number, moment in enumerate(follow_slowly(system, times, options, on_step, clock), 1):
        if moment.time in recorded:
            states[moment.time] = nodal_state_of(system, moment.time)
        noted = {
            "time_s": moment.time,
            "steps": moment.steps,
            "newton_iterations": len(taken),
            "cg_iterations": sum(step.cg_iterations for step in taken),
            "min_J": moment.state.min_J,
            "largest_displacement_mm": 1000.0 * float(np.linalg.norm(moment.state.u, axis=1).max()),
            "relative_residual": moment.state.residual,
        }
        history.append(noted)
        taken.clear()
        watching.slow(number, len(times), noted)
    solution = {"kind": "slow change", "time_s": until, "history": history}
    return Followed(solution, until, (*noted_at, time.perf_counter())[0], clock.seconds, clock.counts, states)


def states_at_rest(case: Case, system: System, end: NodalState, tolerance: float) -> dict[float, NodalState]:
    """The state of each time at which something was recorded, or from which it is counted, of the case of a system.

    `end` is its state long after everything; the tolerance is that of the other equilibria. `SolveError` if there is
    none at one of the times.
    """
    moments = Moments.recorded(case)
    states, near = {math.inf: end}, end.u
    reached: dict[int, NodalState] = {}
    if len(moments.cases) == 1 and moments.cases[0] is case:
        reached[0] = end
    for at, number in zip(moments.times, moments.numbers, strict=True):
        if number not in reached:
            model = replace(model_of(moments.cases[number]), elements=system.model.elements)
            system_then = System(model, str(system.device), system.precision.name)
            equilibrium = EquilibriumSolver(system_then, EquilibriumOptions(tolerance=tolerance)).solve(start=near)
            system_then.u.assign(equilibrium.u)
            reached[number] = nodal_state_of(system_then)
            near = equilibrium.u
        states[at] = reached[number]
    return states


@dataclass(frozen=True, eq=False)
class Run(Shown):
    """A simulated case.

    Attributes
    ----------
    case : Case
    model : Model
        Of the case, with the elements that were asked for or chosen.
    chosen : str or None
        Why these elements, if nobody asked for them.
    result : Result
        The last state.
    observed : Observed
        It, and earlier ones, beside what was recorded.
    followed : Followed
        How it was found.
    """

    case: Case
    model: Model
    chosen: str | None
    result: Result
    observed: Observed
    followed: Followed

    @property
    def mesh(self) -> TetMesh:
        """What is left of the anatomy, undeformed."""
        return self.result.mesh

    @property
    def u(self) -> Floats:
        """Displacement (n, 3) [m]."""
        return self.result.u

    @property
    def errors(self) -> Mapping[str, tuple[float, float]]:
        """Root mean square distance to each recording before and after, in its unit (m, N)."""
        each = self.observed.comparisons
        return {c.name: (c.before.root_mean_square, c.after.root_mean_square) for c in each}


class Running:
    """A case of a body that is about to be simulated; of a specimen see `run`.

    By default `elements` are those that the model needs, given what else is to be done with them, `needed_by` (see
    `choose_elements`). `model` and `chosen` are as those of `Run`.
    """

    def __init__(
        self,
        case: Case,
        course: Course | None = None,
        elements: str | None = None,
        device: str | None = None,
        precision: str = "double",
        needed_by: tuple[str, ...] = (),
    ) -> None:
        self.case = case
        self.course = course or Course()
        model = model_of(case)
        self.chosen: str | None = None
        if elements is None:
            elements, self.chosen = choose_elements(model, needed_by)
        self.model = replace(model, elements=elements)
        self.system = System(self.model, device, precision)

    def run(self, watching: Watching | None = None) -> Run:
        """Simulate it, and compare it with what was recorded; `SolveError` if there is no such state, or none was
        found.
        """
        course, system, watching = self.course, self.system, watching or Watching()
        if course.until is not None:
            followed = _slowly(self.case, system, course.until, course, watching)
        elif course.steps is not None:
            followed = _motion(self.case, system, course.steps, watching)
        else:
            followed = (_to_rest if course.to_rest else _equilibrium)(system, course, watching)
        at = math.inf if followed.time is None else followed.time
        result = result_of(system, at)
        reached = nodal_state_of(system, at)
        states: Mapping[float, Any] = followed.states
        if followed.time is None:
            states = states_at_rest(self.case, system, reached, course.tolerance)
        observed = observe(self.case, reached, followed.time, states)
        return Run(self.case, self.model, self.chosen, result, observed, followed)


def run(
    case: Case | str,
    *,
    tissue: str = "multi",
    steps: int | None = None,
    to_rest: bool = False,
    until: float | None = None,
    tolerance: float = 1e-8,
    time_step: float | None = None,
    elements: str | None = None,
    device: str | None = None,
    precision: str = "double",
) -> Run | SpecimenRun:
    """Simulate a case as ``warpbrain run`` does, to its static equilibrium if nothing else is asked for.

    Parameters
    ----------
    case : Case or str
        A case, the name of a shipped one, or the path of a case folder.
    tissue : str
        ``"multi"`` or ``"single"``, of a case that is named.
    steps : int, optional
        Follow the motion for so many time steps of 1 ms.
    to_rest : bool
        Follow the damped motion until it is at rest.
    until : float, optional
        Follow slow change without inertia until then [s], in `steps` steps that grow (20).
    tolerance : float
        Out-of-balance force at the end, relative to all nodal forces.
    time_step : float, optional
        With `to_rest`: of the steps until its swing was seen [s]; ``run.followed.solution["swing"]`` says how it swung.
    elements : str, optional
        ``"tet4"``, ``"tet4-averaged"``, ``"tet10"`` or ``"tet10-mixed"``; by default those that the case needs.
    device : str, optional
        ``"cpu"``, ``"cuda:0"``, ...; the GPU if there is one.
    precision : str
        ``"double"`` or ``"single"``.

    Returns
    -------
    Run or SpecimenRun
        The state beside what was recorded; of a specimen its tests.

    Raises
    ------
    InputError
        If an argument or the case is wrong: the message names it and the cure.
    SolveError
        If there is no such state: at what load or time, where and why.

    Examples
    --------
    >>> import warpbrain as wb
    >>> done = wb.run("0529", tissue="single")  # doctest: +SKIP
    >>> 1000 * abs(done.u).max()  # mm # doctest: +SKIP
    """
    case = as_case(case, tissue)
    course = Course(steps, to_rest, until, tolerance, time_step)
    if case.specimen is None:
        return Running(case, course, elements, device, precision).run()
    if course != Course(tolerance=tolerance):
        raise InputError(f"steps, to_rest, until: {case.path} has a [specimen], whose tests are quasi-static")
    return SpecimenRunning(case, tolerance, elements, device, precision).run()


def why_not(case: Case) -> str:
    """Why a sound case cannot be run as it stands; empty if it can."""
    try:
        if case.specimen is None:
            require_held(model_of(case))
            return ""
        specimen_of(case)
        for tissue in case.tissues.values():
            _ = tissue.known_law
    except InputError as error:
        return str(error).removeprefix(f"{case.path}: ")
    for recording in case.recordings:
        if isinstance(recording, TestRecording) and (why := not_transmitted(case.specimen.grips, recording.mode)):
            return f"recording '{recording.name}' mode '{recording.mode}': {why}"
    return ""
