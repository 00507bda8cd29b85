"""Motion: implicit backward Euler with Rayleigh damping, in the four phases that the paper times.

    M (v - v0) + h (k_d K + m_d M) v = h (f_ext - f_int(u)),   u = u0 + h v

One step of Newton's method from `v = 0` is the paper's linearised step, written here for `dv = v - v0`:

    A dv = M v0 + h (f_ext - f_int(u0)) - A v0,   A = (1 + h m_d) M + (h k_d + h^2) K(u0),

which is `(M + h D + h^2 K) dv = h (f_ext - f_int - D v0 - h K v0)`. Further iterations (``newton > 1``) solve the
implicit equation itself, with `K v = (A v - (1 + h m_d) M v) / (h k_d + h^2)` in the damping force.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

import numpy as np
import warp as wp

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError, require_kind
from warpbrain.kernels.assembly import dynamics_kernels
from warpbrain.kernels.linear import LinearResult
from warpbrain.kernels.module import Precision
from warpbrain.kernels.multicore import Graph, launch
from warpbrain.seconds import Seconds
from warpbrain.simulation.system import System

#: The paper's phases of a step, in order, by their names in its Table 3.
PHASES = ("internal forces", "assemble system", "solve system", "time integration")
#: Relative tolerance of the linear solve of a step.
STEP_TOLERANCE = 1e-6


def finest_tolerance(tolerance: float, precision: Precision, roundings: float = 20.0) -> float:
    """A relative tolerance of CG, or the finest that the precision allows: so many rounding errors."""
    return max(tolerance, roundings * precision.epsilon)


def fault_of_step(time: float, min_J: float, linear: LinearResult, most_compressed: Callable[[], str]) -> str:
    """What is wrong with the end of a step at a time [s], in words; empty if nothing is."""
    when = f"{1000.0 * time:.4g} ms"
    if min_J <= 0.0:
        # inversion first: it is the cause of what else may be wrong
        return (
            f"{most_compressed()}, turned inside out by {when} (J = {min_J:.3g}): what acts is too much for this "
            "tissue or this time step"
        )
    if not (np.isfinite(linear.residual) and np.isfinite(min_J)):
        return f"the motion is not finite after {when}: conjugate gradients broke down"
    if not linear.converged:
        return (
            f"conjugate gradients did not converge in the step to {when}: residual {linear.residual:.1e} after "
            f"{linear.iterations} iterations, goal {linear.tolerance:.1e}"
        )
    return ""


class PhaseClock:
    """Adds up the wall time of named phases [s], with the device at rest on both sides, and counts them."""

    def __init__(self, device: Any) -> None:
        self._device = device
        self.seconds = Seconds()
        self.counts: dict[str, int] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time a block as part of a phase."""
        wp.synchronize_device(self._device)
        with self.seconds.of(name):
            yield
            wp.synchronize_device(self._device)
        self.counts[name] = self.counts.get(name, 0) + 1


class Simulator:
    """Steps a pre-processed model through time.

    Parameters
    ----------
    system : System
        Its `u` is the displacement; the simulator owns it from now on.
    time_step : float
        `h` [s].
    tolerance : float
        Relative tolerance of each linear solve; never finer than 20 rounding errors of the precision.
    max_cg : int
        Iterations of a linear solve.
    newton : int
        Newton iterations a step; 1 is the paper's linearised step.

    Attributes
    ----------
    v : wp.array of vec3, shape (n,)
        Velocity [m/s].
    time : float
        [s]
    """

    def __init__(
        self,
        system: System,
        *,
        time_step: float = 0.001,
        tolerance: float = STEP_TOLERANCE,
        max_cg: int = 2000,
        newton: int = 1,
    ) -> None:
        require_kind(system, System, "system", "a System, as warpbrain.System(model) gives")
        if newton < 1:
            raise InputError(f"newton = {newton}: expected at least one iteration a step")
        self.system = system
        self.newton = newton
        self.time = 0.0
        self._pending = False
        self.set_time_step(time_step)
        self._kernels = dynamics_kernels(system.precision)
        self.tolerance = finest_tolerance(tolerance, system.precision)
        vec3, n, device = system.precision.vec3, system.size, system.device
        self.v = wp.zeros(n, dtype=vec3, device=device)
        # a linearised step takes each node from its start to its end at once
        self._v_start = self.v if newton == 1 else wp.zeros_like(self.v)
        self._u_start = system.u if newton == 1 else wp.zeros_like(self.v)
        self._v_prescribed = wp.zeros_like(self.v)
        self._moving = False
        self._cg = system.linear_solver(tolerance=self.tolerance, max_iterations=max_cg)
        self._graph: Graph | None = None
        self._graph_moves = False
        system.solution.zero_()
        self._external_factor: tuple[float, ...] | None = None
        self._external_of = system.model
        self.apply_loads()

    def set_time_step(self, time_step: float) -> None:
        """Change `h` [s]; a captured graph is dropped with the step that it was captured for."""
        if not (np.isfinite(time_step) and time_step > 0.0):
            raise InputError(f"time step = {time_step} s: expected a positive number")
        self._remember()
        self._h = time_step
        self._graph = None
        self.system.set_time_step(time_step)

    @property
    def time_step(self) -> float:
        """`h` [s]"""
        return self._h

    # -- what acts ------------------------------------------------------------------------------------------------

    def apply_loads(self) -> None:
        """Set the external forces to the model's loads at the end of the coming step."""
        self.system.set_load(time=self.time + self._h)
        model = self.system.model
        factors = tuple(load.factor(self.time + self._h) for load in model.loads)
        factors += tuple(mechanism.factor(self.time + self._h) for mechanism in model.emptying)
        if factors != self._external_factor or model is not self._external_of:
            self.system.external.assign(model.external_forces(self.time + self._h))
            self._external_factor, self._external_of = factors, model

    def prescribe(self, displacement: Floats) -> None:
        """Move the constrained components to a displacement [m], shape (n, 3), in the coming step; then they rest."""
        velocity = (displacement - self.system.u.numpy()) / self._h
        velocity[~self.system.model.constrained] = 0.0
        self._v_prescribed.assign(velocity)
        self._moving = bool(np.any(velocity))

    def reset(self) -> None:
        """Back to rest in the reference shape."""
        rest = np.zeros((self.system.size, 3))
        self.restore(rest, rest, 0.0)
        self.system.forget()

    def restore(self, u: Floats, v: Floats, time: float) -> None:
        """Set displacement [m] and velocity [m/s], both (n, 3), and time [s].

        Of terms with a memory this is for a step back only: the last step is taken to be undone.
        """
        self._pending = False
        self.system.u.assign(u)
        self.v.assign(v)
        self.time = time
        # the next solve starts from the last change of velocity, which has nothing to do with this state
        self.system.solution.zero_()

    # -- the four phases ------------------------------------------------------------------------------------------

    def internal_forces(self) -> None:
        """Phase 1: forces and tangents of the elements."""
        self.system.evaluate_tangents()

    def assemble_system(self, first: bool = True) -> None:
        """Phase 2: sum the elements into matrix and right-hand side, and renew the preconditioner."""
        s, h, damping = self.system, self._h, self.system.model.damping
        scalar = s.precision.scalar
        k, m = h * damping.stiffness + h * h, 1.0 + h * damping.mass
        # damping is that of the skeleton alone: pore fluid damps by itself, and a time does not make it stiffer
        s.assemble(k, m, coupling=h * h)
        self._cg.multiply(self.v, s.increment)
        if first:
            s.add_coupling(self.v, h * h, s.increment)
        along_Av = -1.0 if first else -damping.stiffness / (damping.stiffness + h)
        along_Mv = 0.0 if first else -m - along_Av * m
        inputs = [*s.forces_on_nodes, s.external, s.mass, self._v_start, self.v, s.increment, s.free]
        inputs += [scalar(h), scalar(along_Mv), scalar(along_Av), s.internal, s.load]
        launch(self._kernels.right_hand_side, s.size, inputs, s.device)
        if self._moving:
            # later iterations have the motion in v and lack only its share of the damping force
            share = h * damping.stiffness
            s.subtract_constrained_load(self._v_prescribed, k if first else share, h * h if first else 0.0)
        self._cg.prepare()

    def solve_system(self, first: bool = True) -> None:
        """Phase 3: conjugate gradients for the change of velocity; a linearised step starts from that of the last."""
        if not first or self.newton > 1:
            self.system.solution.zero_()
        self._cg.solve()

    def integrate(self) -> None:
        """Phase 4: velocity and displacement at the end of the step."""
        s = self.system
        h = s.precision.scalar(self._h)
        inputs = [self._u_start, s.solution, self._v_prescribed, s.free, h, self.v, s.u]
        launch(self._kernels.update, s.size, inputs, s.device)

    def _run_phases(self, clock: PhaseClock | None = None) -> None:
        phase: Callable[[str], AbstractContextManager[Any]] = nullcontext if clock is None else clock.phase
        if self.newton > 1:
            wp.copy(self._v_start, self.v)
            wp.copy(self._u_start, self.system.u)
        for iteration in range(self.newton):
            with phase(PHASES[0]):
                self.internal_forces()
            with phase(PHASES[1]):
                self.assemble_system(first=iteration == 0)
            with phase(PHASES[2]):
                self.solve_system(first=iteration == 0)
            with phase(PHASES[3]):
                self.integrate()

    def _remember(self) -> None:
        """Let terms with a memory keep what they need of the last step: only now is it known that it stands."""
        if self._pending:
            self.system.advance()
        self._pending = False

    def step(self, clock: PhaseClock | None = None) -> None:
        """Advance by one time step; slower with a clock, which is stopped between phases."""
        self._remember()
        self.apply_loads()
        if clock is None and self._graph is not None and self._graph_moves == self._moving:
            self._graph.launch()
        else:
            self._run_phases(clock)
        self.time += self._h
        self._pending = True
        if self._moving:
            self._v_prescribed.zero_()
            self._moving = False

    def step_to(self, share: float, clock: PhaseClock | None = None) -> float:
        """Advance by one time step, timed if there is a clock, to where prescribed displacements are at its end.

        Those without a history of their own are a share of all there, so that a run reaches them evenly. Returns the
        smallest `J`; for errors see `check`.
        """
        self.prescribe(self.system.model.prescribed_at(self.time + self._h, share))
        self.step(clock)
        return self.check()

    def capture(self) -> None:
        """Capture a step in a graph that later steps replay: one launch from the host instead of hundreds.

        Not where a term has unknowns of its own, which are solved for on the host.
        """
        if self.system.coupled:
            return
        self._graph_moves = self._moving
        # a step outside the capture loads every module
        u, v = wp.clone(self.system.u), wp.clone(self.v)
        self._run_phases()
        wp.copy(self.system.u, u)
        wp.copy(self.v, v)
        self.system.solution.zero_()
        graph = Graph(self.system.device)
        with graph.capture():
            self._run_phases()
        self._graph = graph

    # -- looking at the state -------------------------------------------------------------------------------------

    def last_solve(self) -> LinearResult:
        """How the last linear solve ended (waits for the device)."""
        return self._cg.result()

    def check(self) -> float:
        """Smallest `J` of an element.

        Raises
        ------
        SolveError
            If an element is inverted, the state is not finite or the last linear solve failed: when, where and why.
        """
        linear = self.last_solve()
        _, min_J = self.system.energy()
        if fault := fault_of_step(self.time, min_J, linear, self.system.least_of):
            raise SolveError(fault)
        return min_J

    def kinetic_energy(self) -> float:
        """[J]"""
        v = self.v.numpy().astype(np.float64)
        return 0.5 * float(np.sum(self.system.mass.numpy().astype(np.float64)[:, None] * v**2))
