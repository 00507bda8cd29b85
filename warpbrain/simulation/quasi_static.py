"""Slow change: equilibrium at each of a series of times, for tissue that remembers, with inertia left out.

Over minutes a brain is in equilibrium at every moment, while its stress relaxes and its fluid flows away. Every term
takes the step as its own rule says (backward Euler, or of second order); a step in which Newton's method finds no way
is halved.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.simulation.dynamics import PhaseClock
from warpbrain.simulation.equilibrium import Equilibrium, EquilibriumOptions, EquilibriumSolver, NewtonStep
from warpbrain.simulation.factors import KeptFactors
from warpbrain.simulation.model import require_held
from warpbrain.simulation.system import System

#: How often a step is halved before the run gives up.
_HALVINGS = 6


@dataclass(frozen=True)
class Moment:
    """The state at one of the times."""

    time: float  # [s]
    state: Equilibrium  # its history is that of the last step alone
    steps: int  # steps since the time before; more than one where a step was halved


def growing_times(end: float, count: int) -> list[float]:
    """Times [s] up to an end with steps that grow evenly: what flows or relaxes is fast at first, and slower later."""
    return [end * (k / count) ** 2 for k in range(1, count + 1)]


def follow_slowly(
    system: System,
    times: Sequence[float],
    options: EquilibriumOptions | None = None,
    on_step: Callable[[NewtonStep], None] | None = None,
    clock: PhaseClock | None = None,
    near: Sequence[Floats] = (),
    factors: KeptFactors | None = None,
) -> Iterator[Moment]:
    """Equilibria at a series of times [s] that increase from 0, where the body is at rest.

    What acts without a ramp of its own is there from the first step on. A course that is near to this one, `near`, its
    displacements (n, 3) [m] at each of the times or at the first alone, changes no equilibrium, only where the search
    for each begins: at the state before and what the other course goes on by. `options.max_load_step` shares what is
    prescribed within a step; `on_step` is called with each `NewtonStep`; for `factors` see `EquilibriumSolver`.

    Each `Moment` is yielded as soon as it is reached: the system has its displacement, and its terms are at the end of
    the step. `InputError` if the times do not increase from 0, or nothing holds the body; `SolveError` if no
    equilibrium is found: when, where and why.
    """
    series = np.asarray(times, dtype=np.float64)
    if series.ndim != 1 or not len(series) or not (np.isfinite(series) & (np.diff(series, prepend=0) > 0)).all():
        raise InputError(f"times = {list(times)} s: expected positive numbers that increase")
    require_held(system.model)
    solver = EquilibriumSolver(system, options, on_step, clock, factors=factors)
    system.forget()
    u, now, pending = np.zeros(system.model.mesh.points.shape), 0.0, False
    for number, time in enumerate(series.tolist()):
        step, taken = time - now, 0
        # where the state of the step may be, by the state before and the course that is near
        guess = None if number >= len(near) else near[0] if number == 0 else u + (near[number] - near[number - 1])
        while now < time:
            if pending:
                # only now is it known that nobody looks at the state before any more
                system.u.assign(u)
                system.advance()
            pending = False
            # the last step ends at the time itself, whatever the rounding
            end = time if now + 1.5 * step > time else now + step
            try:
                state = solver.try_step(u if guess is None else guess, end - now, end)
            except SolveError:
                if guess is not None:
                    guess = None
                    continue
                step *= 0.5
                if step < (time - now) * 0.5**_HALVINGS:
                    raise
                continue
            u, now, taken, pending = state.u, end, taken + 1, True
        system.u.assign(u)
        yield Moment(time, state, taken)
