"""How an equilibrium changes with its parameters, of laws, mechanisms and loads: the implicit function theorem.

At equilibrium `r = f_int(u, theta) - f_ext(theta) = 0` on the free components, whatever `theta` is, and the constrained
ones are where `theta` prescribes them. Hence

    dr/dtheta = dr/dtheta |_u + K du/dtheta = 0        on the free components
    dR/dtheta = dr/dtheta |_u + K du/dtheta            on the constrained ones, of the reactions `R`

The whole derivative is one five-point difference along the way `(theta + d h e_k, u + d h du_k)`, with an error of
`h^4 g^(5) / 30`, and `du_k` is corrected with the tangent that is stored until nothing is left of it (`refine`): once
where the stored tangent is the true one.

    dg/dtheta_k = sum_d w_d g(theta + d h e_k) / h,    d = -2, -1, 1, 2

With a step `h` of `epsilon^(1/5)` of what changes much it is exact to some 1e-12 in double precision. So no law and no
mechanism has to know its derivatives: none can be wrong, and no adjoint kernels are compiled, which would take twice as
long for every one. What is linear in a parameter (loads, pressures, tensions) is exact but for rounding whatever the
step. What terms remember (of earlier steps, of augmentations) differs from parameter to parameter too. It is kept for
each of the four places beside each parameter, and goes on there along a way of its own (`ParameterStencil`).

A constraint that is met by augmentation (contact) is met beside `theta` too: the multipliers there are augmented along
the same way, and all is balanced again, until nothing changes.

Every parameter is one more right-hand side of one matrix. SciPy's sparse LU takes 1.1 s for its factors on the
phantom's 4187 nodes (2-core CPU, 2026-11), longer than two parameters take by conjugate gradients to 1e-10; it has no
device, and its fill grows faster than the mesh.

Contact that is stuck, slides or lifts off, a falx or a resection that is there or not: nothing lies between two such
states, and so there is no derivative. The whole difference stands where a derivative would.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import SolveError
from warpbrain.kernels.linear import LinearSolver
from warpbrain.physics.term import Term
from warpbrain.simulation.model import Model
from warpbrain.simulation.system import System

#: What a vector of parameters means: a model that differs in numbers only; see `System.set_model`.
ModelOf = Callable[[Floats], Model]
#: What each term of a system remembers.
Remembered = list[tuple[wp.array, ...]]
#: From how far from a parameter a system is to what is differentiated.
Looked = Callable[[float], Floats]

#: Weights of the values at -2, -1, 1 and 2 steps in the derivative.
_STENCIL = {-2: 1.0 / 12.0, -1: -8.0 / 12.0, 1: 8.0 / 12.0, 2: -1.0 / 12.0}


class ParameterStencil:
    """Places beside each of p parameters.

    `models`, from parameters (p,) to models, is smooth and defined a little around `theta` (p,), where the `model` is.
    `scales` (p,) say by how much each must change to change much; by default its size, or 1 if that is less or nothing.
    `steps` (p,) are the `h` of each.
    """

    def __init__(self, system: System, models: ModelOf, theta: ArrayLike, scales: ArrayLike | None = None) -> None:
        self.system = system
        point = np.asarray(theta, dtype=np.float64)
        if scales is None:
            # one over a small exponent of Ogden's law is a modulus: a step must not come near to its sign
            sizes = np.where(point == 0.0, 1.0, np.minimum(1.0, np.abs(point)))
        else:
            sizes = np.asarray(scales, dtype=np.float64)
        self.steps = system.precision.epsilon**0.2 * sizes
        self.model = models(point)
        self._made: dict[int, Term] = {}
        directions = np.diag(self.steps)
        self._places = [{distance: models(point + distance * h) for distance in _STENCIL} for h in directions]
        system.set_model(self.model)
        remembered = system.remembered()
        self._remembered = [dict.fromkeys(_STENCIL, remembered) for _ in self._places]
        self._here = remembered

    def __len__(self) -> int:
        return len(self._places)

    def derivative(self, k: int, look: Looked) -> Floats:
        """The derivative by parameter k of what `look` finds; call it inside `away`."""
        return self._weighted(k, lambda distance: look(self._go(k, distance)))

    def _weighted(self, k: int, value: Callable[[int], Floats]) -> Floats:
        """Derivative by parameter k of what is known at each distance."""
        total: Floats | float = 0.0
        for distance, weight in _STENCIL.items():
            total = total + weight * value(distance)
        return np.asarray(total) / self.steps[k]

    @property
    def remembers(self) -> bool:
        """Whether anything is ever remembered."""
        return any(term.memory for term in self.system.terms)

    def remember(self, act: Callable[[int, float], None]) -> None:
        """Do what changes what is remembered at every place, given parameter and offset; call it inside `away`."""
        for k, remembered in enumerate(self._remembered):
            for distance in _STENCIL:
                act(k, self._go(k, distance))
                remembered[distance] = self.system.remembered()

    def shift_memory(self, before: Remembered, after: Remembered) -> None:
        """Add the same to what is remembered at every place: `after - before`."""
        for remembered in self._remembered:
            for place in remembered.values():
                for arrays, old, new in zip(place, before, after, strict=True):
                    for array, a, b in zip(arrays, old, new, strict=True):
                        array.assign(array.numpy() + (b.numpy() - a.numpy()))

    def _go(self, k: int, distance: int) -> float:
        self.system.set_model(self._places[k][distance], self._made)
        if self.remembers:
            self.system.recall(self._remembered[k][distance])
        return distance * float(self.steps[k])

    @contextmanager
    def away(self) -> Iterator[None]:
        """Afterwards the system has the parameters, the displacement and the memory that it has now."""
        u, self._here = self.system.u.numpy().copy(), self.system.remembered()
        try:
            yield
        finally:
            self.go_back()
            self.system.u.assign(u)

    def go_back(self) -> None:
        """Let the system have the parameters and the memory that it had before it went away; inside `away`."""
        self.system.set_model(self.model, self._made)
        self.system.recall(self._here)

    def by_loads(self, k: int, time: float) -> Floats:
        """Derivative of the external forces [N] at a time [s] by parameter k; nothing is asked of a system."""
        here = (list(self.model.loads), self.model.emptying)
        if all((list(model.loads), model.emptying) == here for model in self._places[k].values()):
            return np.zeros((self.system.size, 3))
        # the product rule: factors and what is left of the tissue, then the loads themselves, which may know better
        factors = self._of_models(k, lambda model: model.external_forces(time, self.model.unit_forces))
        nodes = self.model.quadratic or self.model.mesh

        def of_load(number: int, of: Callable[[Any], Floats]) -> Floats:
            return self._of_models(k, lambda model: of(model.loads[number]))

        rates = [load.unit_forces_rate(nodes, partial(of_load, n)) for n, load in enumerate(self.model.loads)]
        return factors + self.model.external_forces(time, rates)

    def by_prescribed(self, k: int) -> Floats:
        """Derivative of the prescribed displacements [m] by parameter k; nothing is asked of a system."""
        # differences from here, so that what does not change is zero and no rounding
        return self._of_models(k, lambda model: model.prescribed - self.model.prescribed)

    def _of_models(self, k: int, of: Callable[[Model], Floats]) -> Floats:
        """Derivative by parameter k of what a function finds for a model."""
        return self._weighted(k, lambda distance: of(self._places[k][distance]))


#: Directions before it gives up.
_MOST = 40


def lengths(values: Floats, free: Bools) -> Floats:
    """Norm (p,) of each of p fields (p, n, 3) on the free components (n, 3)."""
    return np.asarray(np.linalg.norm(values[:, free], axis=1))


#: Of each correction but the first: it is not exact anyway.
_ROUGH = 1e-3
#: Rounding errors in the forces of a law.
ROUNDINGS = 20.0
#: Of what a parameter puts out of balance: what constraints that are met again may leave.
_MET = 1e-8
#: How often constraints are met again.
_AUGMENTATIONS = 60


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of an equilibrium by p parameters."""

    #: (p, n, 3), of the displacement [m per unit of the parameter]; on constrained components, of what is prescribed
    u: Floats
    reactions: Floats  # (p, n, 3), of what holds the constrained components [N per unit]; zero elsewhere
    cg_iterations: tuple[int, ...]


class SensitivitySolver:
    """Differentiates equilibria of one pre-processed model; what it needs is made once.

    The tolerance is relative: what may be left of the forces that a parameter puts out of balance, no less than
    rounding allows.
    """

    def __init__(self, system: System, tolerance: float = 1e-10, max_cg: int = 10_000) -> None:
        self.system = system
        self._tolerance = max(tolerance, 20.0 * system.precision.epsilon)
        self._solver = system.linear_solver(
            tolerance=self._tolerance, max_iterations=max_cg, watch_curvature=True, at_rest=True
        )

    def solve(self, u: ArrayLike, models: ModelOf, theta: ArrayLike, scales: ArrayLike | None = None) -> Sensitivities:
        """Derivatives by each parameter.

        The system has the model of `theta` and the displacement `u` when this returns. What its terms remember is that
        of the equilibrium, which must be the last that was solved for in it if a term has augmented its constraints.

        `u` (n, 3) [m] is in equilibrium under the model of `theta` (p,) at full load. The models of parameters differ
        from the system's in numbers only; for them and `scales` see `ParameterStencil`.

        `SolveError` if the equilibrium is unstable, so that it has no derivative, or a linear solve does not converge;
        or if it is that of a step in which unknowns of a term's own follow the displacement.
        """
        system = self.system
        if system.coupled:
            raise SolveError(
                "sensitivity: fluid flows in this step, whose derivatives depend on all before: follow them from the "
                "start (warpbrain.simulation.motion_sensitivity)"
            )
        system.set_load()
        state = np.array(u, dtype=np.float64)
        stencil = ParameterStencil(system, models, theta, scales)
        system.u.assign(state)
        system.evaluate_tangents()
        system.assemble(k=1.0, m=0.0)
        if not len(stencil):
            none = np.zeros((0, system.size, 3))
            return Sensitivities(none, none, ())
        corrections = Corrections(self._solver, system, self._tolerance, len(stencil))
        with stencil.away():
            moved, residual = self._balance(stencil, state, corrections)
        constrained = system.model.constrained
        return Sensitivities(moved, np.where(constrained, -residual, 0.0), tuple(corrections.iterations))

    def _balance(self, stencil: ParameterStencil, state: Floats, corrections: Corrections) -> tuple[Floats, Floats]:
        """Derivatives of the displacement, and what is out of balance then on every component."""
        system = self.system
        free = ~system.model.constrained
        loaded = [stencil.by_loads(k, math.inf) for k in range(len(stencil))]
        start = np.array([stencil.by_prescribed(k) for k in range(len(stencil))])

        def left_of(k: int, moved: Floats) -> Floats:
            def internal(offset: float) -> Floats:
                system.u.assign(state + offset * moved)
                return system.internal_forces()

            return loaded[k] - stencil.derivative(k, internal)

        residual = np.array([left_of(k, moved) for k, moved in enumerate(start)])
        # differences are exact to the rounding of forces over the step
        noise = ROUNDINGS * system.precision.epsilon * system.size_of_forces() / stencil.steps
        goals = 2.0 * self._tolerance * lengths(residual, free) + noise
        # a skull's distance has fewer digits than forces have
        met = 2.0 * goals + _MET * lengths(residual, free)
        moved = start
        for _ in range(_AUGMENTATIONS):
            moved, residual = corrections.refine(left_of, moved, residual, goals)
            if not stencil.remembers:
                return moved, residual
            self._meet_constraints(stencil, state, moved)
            residual = np.array([left_of(k, along) for k, along in enumerate(moved)])
            if np.all(lengths(residual, free) <= met):
                return moved, residual
        raise SolveError(f"sensitivities: contacts are not met after {_AUGMENTATIONS} augmentations")

    def _meet_constraints(self, stencil: ParameterStencil, state: Floats, moved: Floats) -> None:
        """Augment beside `theta` along the way, by as much more than in the state itself as belongs to the way."""
        system = self.system

        def augment(displacement: Floats) -> None:
            system.u.assign(displacement)
            for term in system.terms:
                term.augment(system.u)

        stencil.remember(lambda k, offset: augment(state + offset * moved[k]))
        stencil.go_back()
        before = system.remembered()
        augment(state)
        stencil.shift_memory(system.remembered(), before)


class Corrections:
    """Solves for `count` parameters with the system's matrix as it is now, which is a part of the whole one.

    A tangent is stored symmetric: of forces without a potential (a pressure on an open surface, friction) a part of it
    is missing. What is left of a right-hand side at a trial solution, a directional difference of forces, is known
    exactly all the same. So this is GMRES with the stored matrix as preconditioner, in the form of Eisenstat, Elman and
    Schultz (1983, GCR), which allows inexact solves. `stand` brings the system back to the state of its matrix, where
    looking beside it changes what solves need.
    """

    def __init__(
        self,
        solver: LinearSolver,
        system: System,
        tolerance: float,
        count: int,
        stand: Callable[[], None] = lambda: None,
    ) -> None:
        self._solver, self._system, self._stand = solver, system, stand
        self._tolerance, self._free = tolerance, ~system.model.constrained
        #: Of conjugate gradients, for each parameter.
        self.iterations = [0] * count
        solver.prepare()

    def refine(
        self, left_of: Callable[[int, Floats], Floats], solution: Floats, residual: Floats, goals: Floats
    ) -> tuple[Floats, Floats]:
        """Go on from solutions and what is left there, both (p, n, 3), of the right-hand side of each parameter.

        `left_of` says what is left (n, 3) of a right-hand side, by its number, at a trial solution of that shape: an
        affine function. `goals` (p,) are norms of what may be left on the free components. Returns the solutions, and
        what is left on every component; `SolveError` if the known part of the matrix is too far from the whole.
        """
        solution, residual = solution.copy(), residual.copy()
        for k, goal in enumerate(goals.tolist()):
            solution[k], residual[k] = self._refine(k, partial(left_of, k), solution[k], residual[k], goal)
        return solution, residual

    def _refine(
        self, k: int, left_of: Callable[[Floats], Floats], solution: Floats, residual: Floats, goal: float
    ) -> tuple[Floats, Floats]:
        free = self._free
        tried: list[Floats] = []
        gained: list[Floats] = []
        while (size := float(np.linalg.norm(residual[free]))) > goal:
            if len(tried) == _MOST:
                raise SolveError(
                    f"sensitivity to parameter {k}: out of balance by {size:.1e} after {_MOST} corrections, goal "
                    f"{goal:.1e}: the tangent that is stored is far from the true one, or what acts is not smooth here"
                )
            tried.append(self._solve(k, residual))
            now = left_of(solution + tried[-1])
            gained.append(residual - now)
            solution, residual = solution + tried[-1], now
            if np.linalg.norm(now[free]) > goal:
                # and the combination of all directions after which least is left
                columns = np.stack([gain[free] for gain in gained], axis=1)
                sizes = np.linalg.norm(columns, axis=0)
                sizes[sizes == 0.0] = 1.0
                shares = np.linalg.lstsq(columns / sizes, now[free], rcond=1e-12)[0] / sizes
                solution = solution + np.tensordot(shares, np.array(tried), axes=1)
                residual = residual - np.tensordot(shares, np.array(gained), axes=1)
        return solution, residual

    def _solve(self, k: int, residual: Floats) -> Floats:
        """Correct the solution for a parameter: the first time to the tolerance, later roughly."""
        system, constrained = self._system, self._system.model.constrained
        self._stand()
        system.load.assign(np.where(constrained, 0.0, residual))
        system.solution.zero_()
        self._solver.solve(max(self._tolerance, _ROUGH) if self.iterations[k] else self._tolerance)
        linear = self._solver.result()
        self.iterations[k] += linear.iterations
        if linear.indefinite:
            raise SolveError(
                f"sensitivity to parameter {k}: the tangent stiffness is indefinite (curvature "
                f"{linear.curvature:.2e} N/m): the equilibrium is unstable, and does not change smoothly with what "
                "it is of"
            )
        if not linear.converged:
            raise SolveError(
                f"sensitivity to parameter {k}: conjugate gradients did not converge in {linear.iterations} "
                f"iterations (residual {linear.residual:.1e}, goal {linear.tolerance:.1e})"
            )
        return np.where(constrained, 0.0, system.solution.numpy().astype(np.float64))
