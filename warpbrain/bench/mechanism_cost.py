"""What a mechanism costs: steps and equilibria of a case with it and without it, in turns."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import warp as wp

from warpbrain.bench.measure import RESTART
from warpbrain.cases.assuming import assume
from warpbrain.cases.case import Case
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

Result = TypeVar("Result")

#: Both sides of a pair, in the order in which they are measured.
SIDES = ("plain", "with")
#: Steps of each that are not counted: they load kernels and warm up what is warmed up.
WARMUP = 5


@dataclass(frozen=True)
class Cost:
    """Samples of a mechanism beside the plain model, by `SIDES`; those of one index are neighbours in time.

    Attributes
    ----------
    kind, example : str
        Mechanism and what was said of it; the plain model beside itself has no example.
    step : mapping
        Time of a time step, captured in a graph [ms].
    newton : mapping
        Time of an iteration of Newton's method, the mean over an equilibrium [ms].
    cg_iterations : mapping
        Of each time step.
    newton_iterations : mapping
        Of each equilibrium.
    """

    kind: str
    example: str
    step: dict[str, list[float]]
    newton: dict[str, list[float]]
    cg_iterations: dict[str, list[int]]
    newton_iterations: dict[str, list[int]]


def measure_cost(case: Case, kind: str, example: str, device: str, precision: str, steps: int, equilibria: int) -> Cost:
    """Measure a mechanism.

    Parameters
    ----------
    case : Case
        Without it.
    kind, example : str
        An empty example is the plain model once more.
    device, precision : str
    steps, equilibria : int
        Samples of each side.

    Raises
    ------
    SolveError
        If a step or an equilibrium has no solution: there is no cost of that.
    """
    cases = (case, assume(case, example) if example else case)
    systems = {side: System(model_of(one), device, precision) for side, one in zip(SIDES, cases, strict=True)}
    step, cg = _steps(systems, steps)
    newton, iterations = _equilibria(systems, equilibria)
    return Cost(kind, example, step, newton, cg, iterations)


def _steps(systems: dict[str, System], count: int) -> tuple[dict[str, list[float]], dict[str, list[int]]]:
    simulators = {side: Simulator(system) for side, system in systems.items()}
    for simulator in simulators.values():
        simulator.capture()
    taken: dict[str, list[float]] = {side: [] for side in SIDES}
    iterations: dict[str, list[int]] = {side: [] for side in SIDES}
    for sample in range(-WARMUP, count):
        for side, simulator in simulators.items():
            if sample % RESTART == 0 or sample == -WARMUP:
                simulator.reset()
            seconds, _ = _timed(simulator.step, systems[side])
            simulator.check()
            if sample >= 0:
                taken[side].append(1000.0 * seconds)
                iterations[side].append(simulator.last_solve().iterations)
    return taken, iterations


def _equilibria(systems: dict[str, System], count: int) -> tuple[dict[str, list[float]], dict[str, list[int]]]:
    taken: dict[str, list[float]] = {side: [] for side in SIDES}
    iterations: dict[str, list[int]] = {side: [] for side in SIDES}
    for sample in range(-1, count):
        for side, system in systems.items():
            solver = EquilibriumSolver(system)
            seconds, state = _timed(solver.solve, system)
            if sample >= 0:
                taken[side].append(1000.0 * seconds / len(state.history))
                iterations[side].append(len(state.history))
    return taken, iterations


def _timed(call: Callable[[], Result], system: System) -> tuple[float, Result]:
    """Seconds that a call takes, until the device has done it, and what it returns.

    Of the processor on a CPU, which other work on the machine disturbs less.
    """
    now = time.process_time if system.device.is_cpu else time.perf_counter
    wp.synchronize_device(system.device)
    start = now()
    result = call()
    wp.synchronize_device(system.device)
    return now() - start, result
