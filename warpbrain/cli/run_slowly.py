"""`warpbrain run --until`: follow what changes slowly, and print every moment of it."""

from __future__ import annotations

import argparse
import math
import time
from typing import TYPE_CHECKING, Any

from warpbrain.errors import InputError
from warpbrain.terminal.progress import Progress

if TYPE_CHECKING:
    from warpbrain.cases.case import Case
    from warpbrain.simulation.system import System

#: Steps of a run that names no number.
STEPS = 20


def check(options: argparse.Namespace) -> None:
    """Refuse a time that is none, or that nothing can be followed to."""
    if options.until is None:
        return
    if not (math.isfinite(options.until) and options.until > 0.0):
        raise InputError(f"--until {options.until:g}: expected a positive number of seconds")
    if options.to_rest:
        raise InputError(f"--until {options.until:g}: means nothing with --to-rest")
    if options.mesh_error is not None:
        raise InputError(f"--until {options.until:g}: the error of the mesh is not estimated for slow change yet")


def follow(
    options: argparse.Namespace, case: Case, system: System, say: Any
) -> tuple[dict[str, Any], dict[str, float], dict[str, int]]:
    """Follow it; returns what to report, with the states at which something was recorded, and times and counts."""
    from warpbrain.cases.moments import recorded_times
    from warpbrain.simulation.equilibrium import EquilibriumOptions, NewtonStep
    from warpbrain.simulation.phase_clock import PhaseClock
    from warpbrain.simulation.quasi_static import follow_slowly, growing_times
    from warpbrain.simulation.result import NodalState, nodal_state_of

    recorded = {time for time in recorded_times(case, ("fit", "check")) if time <= options.until}
    times = sorted({*growing_times(options.until, options.steps or STEPS), *recorded})
    states: dict[float, NodalState] = {}
    say("", "slow change     time [s]   Newton    CG   min J   largest [mm]", sep="\n")
    progress = Progress("slow change", options.quiet)
    clock = PhaseClock(system.device)
    every = max(1, len(times) // 10)
    first: list[float] = []
    taken: list[NewtonStep] = []
    history: list[dict[str, float]] = []

    def on_step(step: NewtonStep) -> None:
        first.append(time.perf_counter())
        taken.append(step)
        progress.show(len(history) / len(times), f"Newton {step.iteration}")

    try:
        moments = follow_slowly(system, times, EquilibriumOptions(tolerance=options.tolerance), on_step, clock)
        for number, moment in enumerate(moments, 1):
            if moment.time in recorded:
                states[moment.time] = nodal_state_of(system, moment.time)
            largest, least = moment.largest, moment.min_J
            iterations = sum(step.cg_iterations for step in taken)
            history.append(
                {
                    "time_s": moment.time,
                    "steps": moment.steps,
                    "newton_iterations": len(taken),
                    "cg_iterations": iterations,
                    "min_J": least,
                    "largest_displacement_mm": 1000.0 * largest,
                    "relative_residual": moment.state.residual,
                }
            )
            if number % every == 0 or number == len(times):
                progress.clear()
                say(
                    f"            {moment.time:>12.4g} {len(taken):>8} {iterations:>5}   {least:>5.3f}"
                    f"   {1000.0 * largest:>9.3f}"
                )
            taken.clear()
            progress.show(number / len(times), f"{moment.time:.3g} s")
    finally:
        progress.clear()
    outcome = {
        "kind": "slow change",
        "first_step": first[0] if first else time.perf_counter(),
        "time_s": options.until,
        "states": states,
        "history": history,
    }
    return outcome, clock.seconds, clock.counts
