"""Dynamic relaxation: let the damped motion come to rest, with time steps that grow as it slows.

Backward Euler is stable at any step and damps all motion, more the longer the step: it reaches the equilibrium that the
static solve finds, by another way. That makes it the check on the static solve, and the fall-back where Newton's method
finds no way. A body with little damping swings about its rest before; who wants to know how has steps of one length
until that was seen (`RelaxationOptions.swing`, `warpbrain.simulation.swing`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import SolveError, require_kind
from warpbrain.kernels.module import Precision
from warpbrain.simulation.dynamics import STEP_TOLERANCE, PhaseClock, Simulator
from warpbrain.simulation.model import require_held
from warpbrain.simulation.swing import Momentum, Swing
from warpbrain.simulation.system import System

#: Relative tolerance of the linear solve of a step. Rest is judged by the forces themselves, so a step need not be
#: exact: the paper's sweep of the phantom needs a third of the CG iterations of 1e-8, and 2 % more steps.
LINEAR_TOLERANCE = 1e-3
#: Iterations of a linear solve: of the longest steps as many as of an equilibrium.
_MAX_CG = 10_000


@dataclass(frozen=True)
class RelaxationStep:
    """One line of the history."""

    time: float  # [s]
    time_step: float  # [s]
    residual: float  # out-of-balance force relative to the forces in play, at the end of the step
    cg_iterations: int
    min_J: float


@dataclass(frozen=True)
class Relaxed:
    """A state at rest."""

    u: Floats  # displacement (n, 3) [m]
    internal: Floats  # forces (n, 3) [N]
    residual: float  # relative out-of-balance force
    tolerance: float  # what that was to be in this precision
    history: tuple[RelaxationStep, ...]
    swing: Swing | None = None  # how it swung, if that was asked for and it did


@dataclass(frozen=True)
class RelaxationOptions:
    """How to come to rest."""

    #: at rest when ``|f_ext - f_int| <= tolerance (|f_int| + |f_ext|)`` on the free components, now and once relaxed
    tolerance: float = 1e-8
    #: first time step [s]; doubled after a good step, cut to a quarter when an element would turn inside out
    time_step: float = 0.001
    largest_step: float = 1e4  # [s]
    max_steps: int = 400  # steps that grow before giving up
    swing: bool = False  # whether to see how the body swings, with steps that do not grow before
    max_swing_steps: int = 100_000  # steps before giving up a swing


def least_residual(tolerance: float, precision: Precision) -> float:
    """The residual that counts as rest: many steps leave more rounding than one solve."""
    return max(tolerance, 500.0 * precision.epsilon)


def relax_to_rest(
    system: System,
    options: RelaxationOptions | None = None,
    on_step: Callable[[RelaxationStep], None] | None = None,
    clock: PhaseClock | None = None,
) -> Relaxed:
    """Follow the damped motion from rest until nothing moves.

    Prescribed displacements are reached in the first step, or in as many as the elements bear.

    Parameters
    ----------
    system : System
    options : RelaxationOptions
    on_step : callable, optional
        Called with each `RelaxationStep`.
    clock : PhaseClock, optional
        Adds up the wall time by phase.

    Raises
    ------
    InputError
        If nothing holds the body, or a part of it.
    SolveError
        If the motion does not come to rest: when, where and why.
    """
    require_kind(system, System, "system", "a System, as warpbrain.System(model) gives")
    options = options or RelaxationOptions()
    clock = clock or PhaseClock(system.device)
    model = system.model
    require_held(model)
    goal = least_residual(options.tolerance, system.precision)
    free = 1.0 - model.constrained
    external = model.external_forces()
    # where a swing is to be seen it is that of any motion
    tolerance = STEP_TOLERANCE if options.swing else LINEAR_TOLERANCE
    simulator = Simulator(system, time_step=options.time_step, tolerance=tolerance, max_cg=_MAX_CG)
    simulator.reset()
    u, v = np.zeros_like(external), np.zeros_like(external)
    history: list[RelaxationStep] = []
    momentum = Momentum(system.mass.numpy().astype(np.float64)) if options.swing else None
    most = options.max_steps if momentum is None else options.max_swing_steps
    h, moved, share = options.time_step, 0.0, 1.0
    while len(history) < most:
        simulator.set_time_step(h)
        simulator.prescribe(min(1.0, moved + share) * model.prescribed)
        start = simulator.time
        simulator.step(clock)
        try:
            min_J = simulator.check()
        except SolveError as failure:
            # a prescribed displacement that distorts too much is shared among more steps, not hurried
            if moved < 1.0 and np.any(model.prescribed):
                share *= 0.5
            else:
                h *= 0.25
            if h < 1e-3 * options.time_step or share < 1e-3:
                raise SolveError(f"the motion does not come to rest: {failure}") from None
            simulator.restore(u, v, start)
            continue
        arrived, moved = moved >= 1.0, min(1.0, moved + share)
        internal = system.internal_forces()
        residual = float(np.linalg.norm(free * (external - internal)))
        scale = float(np.linalg.norm(internal) + np.linalg.norm(external))
        residual /= max(scale, np.finfo(float).tiny)
        record = RelaxationStep(simulator.time, h, residual, simulator.last_solve().iterations, min_J)
        history.append(record)
        if on_step is not None:
            on_step(record)
        # copies: on the CPU these arrays are the live ones
        u, v = system.u.numpy().copy(), simulator.v.numpy().copy()
        if residual <= goal and moved >= 1.0 and _has_relaxed(system, h, external, goal):
            swing = None if momentum is None else momentum.swing()
            return Relaxed(u.astype(np.float64), internal, residual, goal, tuple(history), swing)
        known = momentum is None or momentum.was_seen
        if momentum is not None and arrived and not known:
            momentum.note(v, h)
            if momentum.was_seen:
                most = len(history) + options.max_steps
        if momentum is None or momentum.was_seen:
            h = min(2.0 * h, options.largest_step)
    raise SolveError(
        f"not at rest after {most} steps, {history[-1].time:.3g} s: relative out-of-balance force "
        f"{history[-1].residual:.1e}, goal {goal:.1e}"
    )


def _has_relaxed(system: System, time_step: float, external: Floats, goal: float) -> bool:
    """Whether nodal forces (n, 3) [N] are balanced once all stress has relaxed, too, to a part `goal` of all forces.

    What creeps slowly is in balance all the time but for its inertia, which is next to nothing.
    """
    if all(term.forgets_in is None for term in system.terms):
        return True
    system.set_time_step(math.inf)
    internal = system.internal_forces()
    system.set_time_step(time_step)
    left = float(np.linalg.norm((external - internal)[~system.model.constrained]))
    return left <= goal * float(np.linalg.norm(internal) + np.linalg.norm(external))
