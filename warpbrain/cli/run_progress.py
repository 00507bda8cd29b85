"""What `warpbrain run` prints of the way to a state: steps on standard output, and how far it has come beside it."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from warpbrain.physics.words import tabled
from warpbrain.simulation.equilibrium import NewtonStep
from warpbrain.simulation.relaxation import RelaxationStep
from warpbrain.simulation.run import Watching
from warpbrain.terminal.progress import Progress

#: Newton iterations that are printed one by one.
_LONG_HISTORY = 16
_INDENT = 12 * " "


@contextmanager
def watching(options: argparse.Namespace, say: Callable[..., None]) -> Iterator[Watching]:
    """Who is told of the steps, after the head of their table is printed."""
    if options.until is not None:
        name, columns = "slow change", "     time [s]   Newton    CG   min J   largest [mm]"
    elif options.steps is not None:
        name, columns = "motion", "        time [ms]     CG   min J   kinetic energy [mJ]"
    elif options.to_rest:
        name, columns = "to rest", "        time [s]  step [s]   residual    CG   min J"
    else:
        name, columns = "equilibrium", "   load   Newton   residual    CG   step   min J"
    say("", name + columns, sep="\n")
    count = 0

    def on_newton(step: NewtonStep) -> None:
        nonlocal count
        count += 1
        # a long history is told by its load steps, not by every iteration
        if count <= _LONG_HISTORY or step.iteration == 1:
            row(
                f"{100 * step.load:>5.1f} % {step.iteration:>6}   {step.residual:>8.1e} "
                f"{step.cg_iterations:>5}  {step.step:>5.3g}   {step.min_J:>5.3f}"
                + ("   indefinite tangent" if step.indefinite else "")
            )
        if count == _LONG_HISTORY:
            say(_INDENT + "(from here on, the first iteration of each load step)")
        progress.show(step.load, f"Newton {step.iteration}")

    def on_relaxation(step: RelaxationStep) -> None:
        row(
            f"{step.time:>11.3g} {step.time_step:>9.3g}   {step.residual:>8.1e} {step.cg_iterations:>5}   "
            f"{step.min_J:>5.3f}"
        )
        decades = math.log10(max(step.residual, 1e-300)) / math.log10(options.tolerance)
        progress.show(min(1.0, max(0.0, decades)), f"{step.time:.3g} s")

    def on_motion(number: int, time: float, noted: dict[str, Any] | None) -> None:
        if noted is not None:
            energy = f"{1000 * noted['kinetic_J']:.4g}"
            row(f"{1000 * time:>11.4g} {noted['cg_iterations']:>6}   {noted['min_J']:>5.3f}   {energy}")
        progress.show(number / options.steps, f"{1000 * time:.0f} ms")

    def on_moment(number: int, moments: int, noted: dict[str, Any]) -> None:
        if number % max(1, moments // 10) == 0 or number == moments:
            row(
                f"{noted['time_s']:>12.4g} {noted['newton_iterations']:>8} {noted['cg_iterations']:>5}"
                f"   {noted['min_J']:>5.3f}   {tabled(noted['largest_displacement_mm']):>9}"
            )
        progress.show(number / moments, f"{noted['time_s']:.3g} s")

    def on_slow_newton(part: float, step: NewtonStep) -> None:
        progress.show(part, f"Newton {step.iteration}")

    def row(text: str) -> None:
        progress.clear()
        say(_INDENT + text)

    with Progress(name, options.quiet) as progress:
        yield Watching(on_newton, on_relaxation, on_motion, on_slow_newton, on_moment)
