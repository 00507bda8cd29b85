"""How a motion changes with its parameters: the derivatives of each step of backward Euler, forward in time.

A step (`warpbrain.simulation.dynamics`) ends with nothing left of

    r = (1 + h m_d) M v - M v0 + c K(u*) v - h (f_ext - f_int(u*)) = 0

on the free components, where the linearised step has `u* = u0` and `c = h k_d + h^2`, and the implicit one
`u* = u0 + h v` and `c = h k_d`. Its whole derivative is one five-point difference along the way of the parameter, the
start of the step, the velocity at its end, and what terms with a memory remember there: a history beside each
parameter, advanced along the way after each step (`warpbrain.simulation.sensitivity`). So mechanisms that need
times or rates are differentiated without knowing it. What is left is corrected with the matrix of the step.

Steps of many seconds are a series of states that are all but at rest, as recordings over minutes have them: inertia and
damping vanish beside the stiffness.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.kernels.linear import LinearSolver
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.sensitivity import ROUNDINGS, Corrections, ModelOf, ParameterStencil, lengths

#: Iterations of a linear solve, and what it may leave of what a parameter puts out of balance in a step.
_MAX_CG, _TOLERANCE = 10_000, 1e-10


class MotionSensitivity:
    """Steps a simulator, and the derivatives of its motion with it.

    As the simulator is now is where all begins: its state does not depend on the parameters `theta` (p,), with whose
    model it goes on. `models` and `scales` are those of `warpbrain.simulation.sensitivity`.

    `u` and `v` (p, n, 3) are the derivatives of displacement [m per unit of the parameter] and velocity [m/s per unit];
    zero on constrained components, which move as they are told to whatever the parameters are.
    """

    def __init__(
        self, simulator: Simulator, models: ModelOf, theta: ArrayLike, scales: ArrayLike | None = None
    ) -> None:
        self.simulator = simulator
        system = simulator.system
        self._tolerance = max(_TOLERANCE, 20.0 * system.precision.epsilon)
        # a step that was taken stands: terms keep what they need of it
        simulator.set_time_step(simulator.time_step)
        self._stencil = ParameterStencil(system, models, theta, scales)
        count = len(self._stencil)
        self._solver: LinearSolver | None = None
        if count:
            self._solver = system.linear_solver(tolerance=self._tolerance, max_iterations=_MAX_CG, watch_curvature=True)
        self.u, self.v = (np.zeros((count, system.size, 3)) for _ in range(2))

    def step(self) -> None:
        """Advance motion and derivatives by one time step, which then stands: the simulator cannot go back.

        `SolveError` if the step has no derivative, or a linear solve does not converge.
        """
        simulator, system, stencil = self.simulator, self.simulator.system, self._stencil
        u_start, v_start = _host(system.u), _host(simulator.v)
        simulator.step()
        if self._solver is None:
            return
        u_end = _host(system.u)
        with stencil.away():
            self.v = self._by_parameters(self._solver, u_start, v_start, u_end)
            self.u = self.u + simulator.time_step * self.v
            if stencil.remembers:

                def advance(k: int, offset: float) -> None:
                    system.u.assign(u_end + offset * self.u[k])
                    system.advance()

                stencil.remember(advance)

    def _by_parameters(self, solver: LinearSolver, u_start: Floats, v_start: Floats, u_end: Floats) -> Floats:
        """Derivatives (p, n, 3) of the velocity at the end of the step."""
        simulator, system, stencil = self.simulator, self.simulator.system, self._stencil
        h, damping = simulator.time_step, system.model.damping
        v_end = _host(simulator.v)
        linearised = simulator.newton == 1
        undamped = h * h if linearised else 0.0
        share = h * damping.stiffness + undamped
        loaded = [h * stencil.by_loads(k, simulator.time) for k in range(len(stencil))]

        def unbalanced(start: Floats, v_before: Floats, v: Floats) -> Floats:
            """`r` but for the loads, where the step begins at a displacement and a velocity."""
            system.u.assign(start if linearised else start + h * v)
            system.evaluate_tangents()
            system.gather_forces()
            inertia = _host(system.mass)[:, None] * ((1.0 + h * damping.mass) * v - v_before)
            # unknowns of a term's own damp by themselves
            return inertia + system.stiffness_times(v, share, undamped) + h * _host(system.internal)

        def left_of(k: int, dv: Floats) -> Floats:
            def look(offset: float) -> Floats:
                return unbalanced(u_start + offset * self.u[k], v_start + offset * self.v[k], v_end + offset * dv)

            return loaded[k] - stencil.derivative(k, look)

        def stand() -> None:
            stencil.go_back()
            system.u.assign(u_start if linearised else u_end)
            system.evaluate_tangents()

        def stand_again() -> None:
            if system.coupled:
                # what terms have of their own is in no matrix, and a look beside changes it
                stand()

        stand()
        system.assemble(h * damping.stiffness + h * h, 1.0 + h * damping.mass, coupling=h * h)
        inertia = float(np.linalg.norm(_host(system.mass)[:, None] * v_end))
        corrections = Corrections(solver, system, self._tolerance, len(stencil), stand_again)
        start = np.zeros_like(self.v)
        residual = np.array([left_of(k, dv) for k, dv in enumerate(start)])
        free = ~system.model.constrained
        # differences are exact to the rounding of what is summed over the step of a parameter
        rounding = ROUNDINGS * system.precision.epsilon * (h * system.size_of_forces() + inertia)
        goals = 2.0 * self._tolerance * lengths(residual, free) + rounding / stencil.steps
        return corrections.refine(left_of, start, residual, goals)[0]


def follow(
    simulator: Simulator, models: ModelOf, theta: ArrayLike, times: Sequence[float], scales: ArrayLike | None = None
) -> Floats:
    """Derivatives (t, p, n, 3) of the displacement [m per unit of the parameter] at times [s] of a motion that
    increase.

    Prescribed displacements without a history of their own are reached evenly over the whole. The simulator, at a time
    before the first, is at the last afterwards; its time step is shortened so that a whole number of equal steps leads
    from each time to the next. For the others see `MotionSensitivity`. `InputError` if the times do not increase;
    `SolveError` if a step fails, or has no derivative.
    """
    ends = [simulator.time, *map(float, times)]
    if not times or not all(a < b for a, b in itertools.pairwise(ends)):
        raise InputError(f"times = {list(times)}: expected times that increase, after {simulator.time:g} s")
    longest, begin = simulator.time_step, simulator.time
    rates = []
    derivatives = MotionSensitivity(simulator, models, theta, scales)
    for start, end in itertools.pairwise(ends):
        steps = max(1, math.ceil((end - start) / longest * (1.0 - 1e-9)))
        simulator.set_time_step((end - start) / steps)
        for _ in range(steps):
            due = simulator.time + simulator.time_step
            simulator.prescribe(simulator.system.model.prescribed_at(due, (due - begin) / (ends[-1] - begin)))
            derivatives.step()
            simulator.check()
        rates.append(derivatives.u)
    return np.array(rates)


def _host(values: wp.array) -> Floats:
    return values.numpy().astype(np.float64)
