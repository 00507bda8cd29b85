"""Static equilibrium: Newton's method with an energy line search, inside load steps that adapt.

The potential is `Pi(u) = stored energy - t f . u` at load fraction `t`. An iterate is accepted only with `J > 0` in
every element and a sufficient decrease of `Pi` (Armijo). Prescribed displacements enter the first linear solve of a
load step through `K d`: writing them into the state first would distort the elements along the boundary before the
interior can follow. Linear systems are solved inexactly while far from the solution (Eisenstat and Walker 1996).

From a start `u0` that is not rest, and does not lead to equilibrium at once, the way is `r(u) = (1 - t) r(u0)`, with
what is out of balance under the full load as `r`: a path of equilibria from the start to that under the load (Newton's
homotopy: Keller 1978, Global homotopies and Newton methods).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError, require_kind
from warpbrain.kernels.linear import LinearResult
from warpbrain.simulation.dynamics import PhaseClock
from warpbrain.simulation.factors import KeptFactors
from warpbrain.simulation.model import require_held
from warpbrain.simulation.multisecant import Multisecant
from warpbrain.simulation.system import System
from warpbrain.threads import one_thread_of_blas

#: Out-of-balance force, relative, from which on steps say something of the steps to come.
_NEAR = 0.1
#: Terms of a stress that are rounded.
_TERMS = 2.0


@dataclass(frozen=True)
class NewtonStep:
    """One line of the solver's history."""

    load: float  # load fraction that is being solved for
    iteration: int  # Newton iteration within the load step, from 1
    residual: float  # norm of the out-of-balance force before the iteration, relative to the forces in play
    cg_iterations: int
    step: float  # length of the accepted step, 1 for a full one
    min_J: float  # smallest volume ratio after the step
    #: the tangent was seen not to be positive definite, and a multiple of the mass was added to it until it was
    indefinite: bool = False


@dataclass(frozen=True)
class EquilibriumOptions:
    """How to solve.

    Attributes
    ----------
    tolerance : float
        Converged when ``|r| <= tolerance (|f_int| + |f_ext|)``: out-of-balance force on the free components against
        all nodal forces, reactions included.
    max_newton : int
        Iterations in a load step before it is cut.
    max_total_newton : int
        Iterations in all before the solve gives up.
    max_load_step, min_load_step : float
        Largest load step, and the smallest before the solve gives up. A small largest step follows the path of a
        slowly growing load; with the default of 1 Newton's method may land on another branch beyond a limit point.
    cg_tolerance : float
        Loosest relative tolerance of a linear solve; tightened as Newton converges.
    max_cg : int
        Iterations of a linear solve.
    pass_unstable : bool
        What to do where the tangent is indefinite, at limit and branching points of the equilibrium path. True: go on
        downhill, as the damped body would (snap-through), and say so in the history. False: end there with an error
        that names it. Negative curvature is seen only along the search directions of CG, not in every direction.
    contracts : bool
        Whether Newton steps must be whole ones, and each expected to gain less energy than the one before it: where
        they are not the load step is cut. Other iterations may come to an end far from where they began, or to none, as
        they are rounded (Deuflhard 2011, Newton Methods for Nonlinear Problems, section 3.3).
    max_augmentations : int
        Solves in all to meet the constraints that penalties stand for (contact).
    """

    tolerance: float = 1e-8
    max_newton: int = 30
    max_total_newton: int = 150
    max_load_step: float = 1.0
    min_load_step: float = 1.0 / 1024.0
    cg_tolerance: float = 0.03
    max_cg: int = 10_000
    pass_unstable: bool = True
    contracts: bool = False
    max_augmentations: int = 20

    def __post_init__(self) -> None:
        for name in ("tolerance", "cg_tolerance"):
            value = getattr(self, name)
            if not 0.0 < value < 1.0:
                raise InputError(f"equilibrium: {name} = {value}: expected a number between 0 and 1")
        if not 0.0 < self.min_load_step <= self.max_load_step <= 1.0:
            raise InputError(
                f"equilibrium: min_load_step = {self.min_load_step}, max_load_step = {self.max_load_step}: expected "
                "numbers above 0 and at most 1, the first the smaller"
            )


@dataclass(frozen=True)
class Equilibrium:
    """A converged state.

    Attributes
    ----------
    u : (n, 3) array
        Displacement [m].
    internal : (n, 3) array
        Internal forces [N]; on constrained components they are the reactions.
    energy : float
        Stored energy [J].
    residual : float
        Relative out-of-balance force reached.
    history : tuple of NewtonStep
    """

    u: Floats
    internal: Floats
    energy: float
    residual: float
    history: tuple[NewtonStep, ...]

    @property
    def unstable_iterations(self) -> int:
        """Newton iterations in which the tangent was seen to be indefinite, those of load steps cut since included."""
        return sum(step.indefinite for step in self.history)

    @property
    def min_J(self) -> float:
        """Smallest volume ratio of an element; 1 where nothing moved."""
        return self.history[-1].min_J if self.history else 1.0


class _StepFailed(Exception):
    """A load step that must be cut; the message says why."""


class EquilibriumSolver:
    """Finds equilibria of one pre-processed model.

    Parameters
    ----------
    system : System
    options : EquilibriumOptions
    on_step : callable, optional
        Called with each `NewtonStep` as it is taken.
    clock : PhaseClock, optional
        Adds up the wall time by phase.
    factors : KeptFactors, optional
        Kept by who solves for many states that are near to each other; they serve on the CPU alone.

    Attributes
    ----------
    clock : PhaseClock
        Wall time by phase.
    """

    def __init__(
        self,
        system: System,
        options: EquilibriumOptions | None = None,
        on_step: Callable[[NewtonStep], None] | None = None,
        clock: PhaseClock | None = None,
        factors: KeptFactors | None = None,
    ) -> None:
        require_kind(system, System, "system", "a System, as warpbrain.System(model) gives")
        self.system = system
        self.options = options or EquilibriumOptions()
        self._on_step = on_step
        self.clock = clock or PhaseClock(system.device)
        self._linear = system.linear_solver(
            tolerance=self.options.cg_tolerance,
            max_iterations=self.options.max_cg,
            watch_curvature=True,
            at_rest=True,
            factors=factors,
        )
        self._history: list[NewtonStep] = []
        self._free = 1.0 - system.model.constrained
        # residuals cannot fall below the rounding of the sums of element forces
        self.tolerance = max(self.options.tolerance, 50.0 * system.precision.epsilon)
        # force and energy of the order of rounding, so that a body without any load is in equilibrium; a stress is a
        # sum of some terms that are as large as moduli, each of which is rounded
        stiffest = max(m.law.shear_modulus + abs(m.volumetric_modulus) for m in system.model.materials.values())
        self._noise = _TERMS * system.precision.epsilon * stiffest * system.model.mesh.volume ** (2.0 / 3.0)
        self._energy_noise = _TERMS * system.precision.epsilon * stiffest * system.model.mesh.volume

    def solve(
        self, external: Floats | None = None, start: Floats | None = None, prescribed: Floats | None = None
    ) -> Equilibrium:
        """Go from a start (rest by default) to equilibrium at full load.

        Parameters
        ----------
        external : (n, 3) array, optional
            Nodal forces at full load [N]; those of the model by default.
        start : (n, 3) array, optional
            Displacement to start from [m], near to the equilibrium. Where that is not found at once, what the start has
            out of balance is taken off in the place of load steps.
        prescribed : (n, 3) array, optional
            Displacement of the constrained components at full load [m]; that of the model by default.

        Returns
        -------
        Equilibrium

        Raises
        ------
        InputError
            If nothing holds the body, or a part of it.
        SolveError
            If no equilibrium is found: at what load fraction, where and why.
        """
        model = self.system.model
        require_held(model)
        full = model.external_forces() if external is None else external
        u = np.zeros_like(full) if start is None else np.array(start, dtype=np.float64)
        self.system.set_time_step(math.inf)
        self.system.forget()
        with one_thread_of_blas():
            prescribed = model.prescribed if prescribed is None else prescribed
            return self._follow(u, full, prescribed, from_rest=start is None)

    def linear_estimate(self) -> Floats:
        """Displacement (n, 3) [m] at full load if the body kept the stiffness that it has at rest.

        Raises
        ------
        InputError
            If nothing holds the body, or a part of it.
        SolveError
            If the stiffness at rest is not positive definite.
        """
        model, system = self.system.model, self.system
        require_held(model)
        system.set_time_step(math.inf)
        system.forget()
        system.set_load(1.0)
        rest = np.zeros_like(model.prescribed)
        system.u.assign(rest)
        system.evaluate_tangents()
        system.gather_forces()
        r = self._free * (model.external_forces() - system.internal.numpy().astype(np.float64))
        prescribed = np.where(model.constrained, model.prescribed, 0.0)
        d, linear = self._direction(r, prescribed, self.options.cg_tolerance, 0.0)
        if linear.indefinite or not np.isfinite(d).all():
            raise SolveError("the stiffness of the body at rest is not positive definite")
        return d

    def step(
        self, start: Floats, time_step: float, time: float = math.inf, prescribed: Floats | None = None
    ) -> Equilibrium:
        """Go on from a state to the equilibrium a time step later, slowly: without inertia, but with memory.

        Terms with a memory keep it and take the step into it. To begin at rest, let them forget first (`Term.forget`).

        Parameters
        ----------
        start : (n, 3) array
            Displacement [m] before the step.
        time_step : float
            [s]; 0 for a change that is over at once.
        time : float
            At the end of the step [s], for what has a ramp; by default long after every one.
        prescribed : (n, 3) array, optional
            Displacement of the constrained components at the end of the step [m]; that of the model by default.

        Raises
        ------
        InputError, SolveError
            As `solve`.
        """
        equilibrium = self.try_step(start, time_step, time, prescribed)
        self.system.u.assign(equilibrium.u)
        self.system.advance()
        return equilibrium

    def try_step(
        self, start: Floats, time_step: float, time: float = math.inf, prescribed: Floats | None = None
    ) -> Equilibrium:
        """As `step`, but terms with a memory do not take the step into it: what they say is still of its end."""
        model = self.system.model
        require_held(model)
        self.system.set_time_step(time_step)
        prescribed = model.prescribed_at(time, 1.0) if prescribed is None else prescribed
        with one_thread_of_blas():
            return self._follow(np.array(start, dtype=np.float64), model.external_forces(time), prescribed, time)

    def _follow(
        self, start: Floats, full: Floats, prescribed: Floats, time: float = math.inf, from_rest: bool = False
    ) -> Equilibrium:
        """Go from a state to full load, from rest in load steps; see the module. What acts is that of the time.

        With one thread of BLAS: a sum over nodes takes less than to wake others, and bits would depend on their number.
        """
        model = self.system.model
        origin = np.where(model.constrained, start, 0.0)
        self._history = []
        u, done, step = start, 0.0, self.options.max_load_step
        out_of_balance: Floats | None = None
        while done < 1.0:
            load = min(1.0, done + step)
            target = origin + load * (prescribed - origin * model.constrained)
            self.system.set_load(load if from_rest else 1.0, time)
            external = load * full if from_rest else full
            try:
                if load < 1.0 and not from_rest:
                    if out_of_balance is None:
                        self.system.u.assign(start)
                        out_of_balance = self._free * (full - self.system.internal_forces())
                    if not np.isfinite(out_of_balance).all():
                        raise _StepFailed("the out-of-balance force of the start is not finite")
                    external = full - (1.0 - load) * out_of_balance
                reached, energy, residual = self._newton(u, load, external, target)
            except _StepFailed as failure:
                tried, step = step, 0.5 * step
                exhausted = len(self._history) >= self.options.max_total_newton
                if not exhausted and step >= self.options.min_load_step:
                    continue
                text = (
                    f"no equilibrium found beyond {100.0 * done:.3g} % of the load, after {len(self._history)} Newton "
                    f"iterations and load steps down to {100.0 * tried:.2g} %: {failure}"
                )
                if unstable := sum(record.indefinite for record in self._history):
                    text += (
                        f". The tangent stiffness was indefinite in {unstable} iterations: under this load the body "
                        "passes unstable states, as when part of it collapses"
                    )
                raise SolveError(text) from None
            u, done, step = reached, load, min(2.0 * step, self.options.max_load_step)
            if done == 1.0:
                u, energy, residual = self._augmented(u, full, target, energy, residual)
        return Equilibrium(u, self.system.internal.numpy().astype(np.float64), energy, residual, tuple(self._history))

    def _augmented(
        self, u: Floats, full: Floats, target: Floats, energy: float, residual: float
    ) -> tuple[Floats, float, float]:
        """Solve again until constraints that penalties stand for are met."""
        for _ in range(self.options.max_augmentations):
            self.system.u.assign(u)
            before = self.system.remembered()
            closer = [term.augment(self.system.u) for term in self.system.terms]
            if not any(closer):
                if any(before):
                    # what the state is in equilibrium with, not what another augmentation would have
                    self.system.recall(before)
                    self.system.evaluate_forces()
                    self.system.gather_forces()
                return u, energy, residual
            try:
                u, energy, residual = self._newton(u, 1.0, full, target)
            except _StepFailed as failure:
                raise SolveError(f"no equilibrium found while coming closer to a contact: {failure}") from None
        raise SolveError(
            f"a contact is not closed after {self.options.max_augmentations} augmentations: give it a larger penalty"
        )

    def _newton(self, start: Floats, load: float, external: Floats, target: Floats) -> tuple[Floats, float, float]:
        """Newton's method at one load; returns displacement, stored energy and relative residual."""
        system, options = self.system, self.options
        u = start.copy()
        potential, _ = self._potential(u, external)
        previous = np.inf
        forcing = options.cg_tolerance
        shift = 0.0
        # whether the last step should have led to balance: then there is no need of a tangent
        closes = False
        # of forces without a potential the linear solver has a part of the tangent
        secants = None if all(term.conservative for term in system.terms) else Multisecant()
        largest = np.inf
        for iteration in range(1, options.max_newton + 1):
            with self.clock.phase("internal forces"):
                system.u.assign(u)
                if closes:
                    system.evaluate_forces()
                else:
                    system.evaluate_tangents()
                system.gather_forces()
            internal = system.internal.numpy().astype(np.float64)
            r = self._free * (external - internal)
            # far from any equilibrium a norm is infinite, which ends this
            with np.errstate(over="ignore"):
                scale = float(np.linalg.norm(internal) + np.linalg.norm(external))
                norm = float(np.linalg.norm(r))
            # converged when norm <= tolerance * scale + noise; what has grown has larger faces for the same stress
            noise = self._noise * float(system.growth_stretches.max()) ** 2
            relative = norm / (scale + noise / self.tolerance)
            prescribed = np.where(system.model.constrained, target - u, 0.0)
            moving = bool(np.any(prescribed))
            if not np.isfinite(norm):
                raise _StepFailed("the out-of-balance force is not finite")
            if not moving and relative <= self.tolerance:
                return u, potential + float(np.vdot(external, u)), relative
            if closes:
                with self.clock.phase("internal forces"):
                    system.evaluate_tangents()
            # Eisenstat-Walker: as exact as Newton's own error deserves, and no more exact than the goal needs
            if moving:
                eta = min(options.cg_tolerance, 1e-3)
            else:
                ratio = norm / previous if np.isfinite(previous) else 1.0
                eta = min(options.cg_tolerance, max(0.9 * ratio**2, 0.9 * forcing**2 if forcing**2 > 0.1 else 0.0))
                eta = max(eta, 0.3 * self.tolerance / relative, 20.0 * system.precision.epsilon)
            forcing, previous = eta, np.inf if moving else norm
            closes = not moving and eta * relative <= self.tolerance
            if len(self._history) >= options.max_total_newton:
                raise _StepFailed(
                    f"not in balance yet (relative residual {relative:.1e}, goal {self.tolerance:.1e})"
                    f"{self._worst_element()}"
                )
            # far from equilibrium the tangent changes too much from step to step
            near = secants is not None and not moving and relative < _NEAR
            predicted, remaining = secants.split(u, r) if secants is not None and near else (0.0, r)
            d, linear, shift, indefinite = self._descent(remaining, prescribed, min(eta, 0.5), shift)
            d = d + predicted
            if options.contracts and secants is None and not moving:
                # half the square of Newton's decrement: unlike lengths it is right where systems are solved roughly,
                # which leaves most of what is soft
                gain = 0.5 * float(np.vdot(r, d))
                if not gain < largest:
                    raise _StepFailed(f"Newton's method does not contract: {largest:.1e} J to gain, then {gain:.1e} J")
                largest = gain
            with self.clock.phase("line search"):
                alpha, u, potential, min_J = self._line_search(u, d, r, external, potential, moving)
            if options.contracts and alpha < 1.0:
                raise _StepFailed(f"a whole step of Newton's method leads too far{self._worst_element()}")
            record = NewtonStep(load, iteration, relative, linear.iterations, alpha, min_J, indefinite)
            # try the tangent itself again soon: only that converges quadratically
            shift = 0.1 * shift if shift > self._least_shift else 0.0
            self._history.append(record)
            if self._on_step is not None:
                self._on_step(record)
        raise _StepFailed(
            f"Newton's method did not converge in {options.max_newton} iterations "
            f"(relative residual {relative:.1e}, goal {self.tolerance:.1e}){self._worst_element()}"
        )

    @cached_property
    def _least_shift(self) -> float:
        """A multiple of the mass that is just felt beside the tangent: 0.1 % of its mean diagonal [1/s2]."""
        # picked on the device: the whole matrix takes longer to copy than a system to solve
        diagonal = self.system.matrix.values[self.system.diagonal].numpy()
        stiffness = float(np.mean(np.trace(diagonal, axis1=1, axis2=2))) / 3.0
        return 1e-3 * abs(stiffness) / float(np.mean(self.system.model.node_masses))

    def _descent(
        self, r: Floats, prescribed: Floats, eta: float, shift: float
    ) -> tuple[Floats, LinearResult, float, bool]:
        """Newton's direction, with as much of the mass added to the tangent as makes it positive definite.

        Returns the direction, how CG ended, the multiple of the mass, and whether an indefinite tangent was seen.
        """
        indefinite = False
        while True:
            d, linear = self._direction(r, prescribed, eta, shift)
            if not linear.indefinite:
                break
            indefinite = True
            unstable = (
                f"the tangent stiffness is indefinite (curvature {linear.curvature:.2e} N/m along a search direction): "
                f"the equilibrium path turns or branches here{self._worst_element()}"
            )
            if not self.options.pass_unstable or shift > 1e6 * self._least_shift:
                raise _StepFailed(unstable)
            shift = max(10.0 * shift, self._least_shift)
        if not np.all(np.isfinite(d)):
            where = self._worst_element()
            raise _StepFailed(f"conjugate gradients broke down after {linear.iterations} iterations{where}")
        if not linear.converged:
            raise _StepFailed(
                f"conjugate gradients did not converge in {linear.iterations} iterations "
                f"(residual {linear.residual:.1e}, goal {linear.tolerance:.1e})"
            )
        return d, linear, shift, indefinite

    def _direction(self, r: Floats, prescribed: Floats, eta: float, shift: float) -> tuple[Floats, LinearResult]:
        """Solve `(K + shift M) d = r`, with prescribed increments."""
        system = self.system
        with self.clock.phase("assemble system"):
            system.assemble(k=1.0, m=shift)
            system.load.assign(r)
            if prescribed.any():
                system.increment.assign(prescribed)
                system.subtract_constrained_load(system.increment, 1.0)
            system.solution.zero_()
        with self.clock.phase("solve system"):
            self._linear.prepare()
            self._linear.solve(eta)
        linear = self._linear.result()
        return system.solution.numpy().astype(np.float64) * self._free + prescribed, linear

    def _potential(self, u: Floats, external: Floats) -> tuple[float, float]:
        self.system.u.assign(u)
        energy, min_J = self.system.energy()
        return energy - float(np.vdot(external, u)), min_J

    def _line_search(
        self, u: Floats, d: Floats, r: Floats, external: Floats, potential: float, moving: bool
    ) -> tuple[float, Floats, float, float]:
        slope = -float(np.vdot(r, d))
        # below this a change of the potential is rounding
        noise = 100.0 * self.system.precision.epsilon * (abs(potential) + float(np.sum(np.abs(external * u))))
        noise += self._energy_noise
        if not moving and slope > noise:
            raise _StepFailed("Newton's direction does not descend: the tangent stiffness is not positive definite")
        alpha = 1.0
        min_J = np.nan
        before = self.system.forces_without_potential(u)
        while alpha > 1e-3:
            trial = u + alpha * d
            reached, min_J = self._potential(trial, external)
            after = self.system.forces_without_potential(trial)
            # of forces without a potential, the work along the step by the trapezoidal rule
            work = 0.0 if before is None or after is None else 0.5 * alpha * float(np.vdot(before + after, d))
            descends = moving or reached + work <= potential + 1e-4 * alpha * slope + noise
            if min_J > 0.0 and np.isfinite(reached) and descends:
                return alpha, trial, reached, min_J
            alpha *= 0.5
        why = "elements turn inside out" if not min_J > 0.0 else "the energy does not decrease"
        raise _StepFailed(f"{why} along Newton's direction, however short the step{self._worst_element()}")

    def _worst_element(self) -> str:
        """Where the element with the smallest J of the last evaluation is, for a message."""
        return f"; most compressed {self.system.least_of()}, J = {np.min(self.system.element_J.numpy()):.3g}"


def solve_equilibrium(
    system: System, options: EquilibriumOptions | None = None, on_step: Callable[[NewtonStep], None] | None = None
) -> Equilibrium:
    """Equilibrium of a pre-processed model at full load; see `EquilibriumSolver`."""
    return EquilibriumSolver(system, options, on_step).solve()
