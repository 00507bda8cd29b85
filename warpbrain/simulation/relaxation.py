"""Dynamic relaxation: let the damped motion come to rest, with time steps that grow as it slows.

Backward Euler is stable at any step and damps all motion, more the longer the step: it reaches the equilibrium that the
static solve finds, by another way. That makes it the check on the static solve, and the fall-back where Newton's method
finds no way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import SolveError
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.system import System


@dataclass(frozen=True)
class RelaxationStep:
    """One line of the history.

    Attributes
    ----------
    time, time_step : float
        [s]
    residual : float
        Out-of-balance force relative to the forces in play, at the end of the step.
    cg_iterations : int
    min_J : float
    """

    time: float
    time_step: float
    residual: float
    cg_iterations: int
    min_J: float


@dataclass(frozen=True)
class Relaxed:
    """A state at rest; `u` (n, 3) [m], `internal` (n, 3) [N], relative out-of-balance force and history."""

    u: NDArray[np.float64]
    internal: NDArray[np.float64]
    residual: float
    history: tuple[RelaxationStep, ...]


def relax_to_rest(
    system: System,
    *,
    tolerance: float = 1e-8,
    time_step: float = 0.001,
    largest_step: float = 1e4,
    max_steps: int = 400,
    on_step: Callable[[RelaxationStep], None] | None = None,
) -> Relaxed:
    """Follow the damped motion from rest until nothing moves.

    Parameters
    ----------
    system : System
    tolerance : float
        At rest when ``|f_ext - f_int| <= tolerance (|f_int| + |f_ext|)`` on the free components.
    time_step : float
        First time step [s]; doubled after a good step, cut to a quarter when an element would turn inside out.
    largest_step : float
        [s]
    max_steps : int
    on_step : callable, optional
        Called with each `RelaxationStep`.

    Raises
    ------
    SolveError
        If the motion does not come to rest: when, where and why.
    """
    goal = max(tolerance, 50.0 * system.precision.epsilon)
    free = 1.0 - system.model.constrained
    external = system.model.external_forces()
    external_norm = float(np.linalg.norm(external))
    u, v = np.zeros_like(external), np.zeros_like(external)
    system.u.assign(u)
    simulator = Simulator(system, time_step=time_step, tolerance=1e-8)
    simulator.prescribe(system.model.prescribed)
    history: list[RelaxationStep] = []
    h = time_step
    while len(history) < max_steps:
        simulator.set_time_step(h)
        simulator.prescribe(system.model.prescribed)
        start = simulator.time
        simulator.step()
        try:
            min_J = simulator.check()
        except SolveError as failure:
            if h < 1e-3 * time_step:
                raise SolveError(f"the motion does not come to rest: {failure}") from None
            h *= 0.25
            system.u.assign(u)
            simulator.v.assign(v)
            simulator.time = start
            continue
        system.evaluate_forces()
        system.gather_forces()
        internal = system.internal.numpy().astype(np.float64)
        residual = float(np.linalg.norm(free * (external - internal)))
        residual /= max(float(np.linalg.norm(internal)) + external_norm, np.finfo(float).tiny)
        record = RelaxationStep(simulator.time, h, residual, simulator.last_solve().iterations, min_J)
        history.append(record)
        if on_step is not None:
            on_step(record)
        u, v = system.u.numpy(), simulator.v.numpy()
        if residual <= goal:
            return Relaxed(u.astype(np.float64), internal, residual, tuple(history))
        h = min(2.0 * h, largest_step)
    raise SolveError(
        f"not at rest after {max_steps} steps, {history[-1].time:.3g} s: relative out-of-balance force "
        f"{history[-1].residual:.1e}, goal {goal:.1e}"
    )
