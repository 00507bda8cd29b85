"""`python -m warpbrain.bench mechanisms`: what each mechanism costs beside the plain model.

Steps and equilibria of a case with it and without it take turns.
"""

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import date
from statistics import median
from typing import Any, TypeVar

import warp as wp

from warpbrain.atomic import safe_name
from warpbrain.bench import command
from warpbrain.bench.measure import RESTART
from warpbrain.cases.assuming import assume
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.kernels.module import find_device
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.terminal.progress import Progress

Result = TypeVar("Result")

#: The case that examples of mechanisms are said of, and the row of the plain model beside itself.
BASE, PLAIN = "phantom-loaded", "plain"
#: Both sides of a pair, in the order in which they are measured.
SIDES = ("plain", "with")
#: Steps of each that are not counted: they load kernels and warm up what is warmed up.
WARMUP = 5


def ratio(samples: Mapping[str, Sequence[float]]) -> float:
    """How much longer it took with a mechanism than without: the median over neighbours in time."""
    return median(b / a for a, b in zip(samples["plain"], samples["with"], strict=True))


def bench(options: argparse.Namespace) -> None:
    """Measure and print."""
    known = mechanisms()
    kinds = command.chosen("--kinds", options.kinds, list(known))
    versions, device, today = command.start(options), find_device(options.device), date.today().isoformat()
    command.say("mechanisms", device, BASE, options, command.release(versions))
    case, progress = find_case(BASE), Progress("bench")
    rows: list[dict[str, Any]] = []
    for number, kind in enumerate([PLAIN, *kinds]):
        progress.show(number / (len(kinds) + 1), kind)
        example = "" if kind == PLAIN else known[kind].example
        cost = measure_cost(case, kind, example, device.alias, options.precision, options.steps, options.equilibria)
        progress.clear()
        rows.append(cost)
        command.say("mechanism", cost, ratio, median)
    short = "cpu" if device.is_cpu else safe_name(device.name.lower().removeprefix("nvidia "))
    name = command.processor() if device.is_cpu else device.name
    measured = {"versions": versions, "device": name, "date": today, "precision": options.precision, "case": BASE}
    path = options.out and options.out / f"mechanisms_{short}_{today}.json"
    command.write(path, {**measured, "rows": rows})


def measure_cost(
    case: Case, kind: str, example: str, device: str, precision: str, steps: int, equilibria: int
) -> dict[str, Any]:
    """Measure a mechanism beside a case without it, so many samples of each; no example is the plain model once more.

    Returns samples by `SIDES`, those of one index neighbours in time: of `step`, a time step captured in a graph [ms],
    and of `newton`, an iteration of Newton's method in the mean over an equilibrium [ms]; and the iterations of each.

    `SolveError` if a step or an equilibrium has no solution: there is no cost of that.
    """
    cases = (case, assume(case, example) if example else case)
    systems = {side: System(model_of(each), device, precision) for side, each in zip(SIDES, cases, strict=True)}
    simulators = {side: Simulator(system) for side, system in systems.items()}
    for simulator in simulators.values():
        simulator.capture()

    def taken(side: str, sample: int) -> tuple[float, int]:
        simulator = simulators[side]
        if sample % RESTART == 0 or sample == -WARMUP:
            simulator.reset()
        seconds, _ = _timed(simulator.step, systems[side])
        simulator.check()
        return seconds, simulator.last_solve().iterations

    def solved(side: str, sample: int) -> tuple[float, int]:
        seconds, state = _timed(EquilibriumSolver(systems[side]).solve, systems[side])
        return seconds / len(state.history), len(state.history)

    step, cg = _in_turns(systems, WARMUP, steps, taken)
    newton, iterations = _in_turns(systems, 1, equilibria, solved)
    costs = {"step": step, "newton": newton, "cg_iterations": cg, "newton_iterations": iterations}
    return {"kind": kind, "example": example, **costs}


def _in_turns(
    systems: dict[str, System], warmup: int, count: int, take: Callable[[str, int], tuple[float, int]]
) -> tuple[dict[str, list[float]], dict[str, list[int]]]:
    """Samples of both sides in turns: time [ms] and iterations of `take(side, sample)`, negative ones not counted."""
    taken: dict[str, list[float]] = {side: [] for side in SIDES}
    iterations: dict[str, list[int]] = {side: [] for side in SIDES}
    for sample in range(-warmup, count):
        for side in systems:
            seconds, number = take(side, sample)
            if sample >= 0:
                taken[side].append(1000.0 * seconds)
                iterations[side].append(number)
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
