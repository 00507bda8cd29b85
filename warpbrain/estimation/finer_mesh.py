"""What the mesh gets wrong: the state on elements of half the size, less the state; of fits and of diagnoses.

Linear tetrahedra are too stiff, near nu = 1/2 by several percent of the displacement on the meshes that one can afford.
Recordings know nothing of elements: fitted as it is, such a mesh finds tissue that is too soft by as much, and says so
with a standard deviation that is far smaller than that. So what is recorded is taken to be

    H(u_h + (a I + B(x)) d(theta)) + H' s(theta) + noise,    d = u_(h/2) - u_h

What falls with a power p of the size is the error of the stiffness, since a mesh that is far too stiff shows little of
its error when halved: `1/u_h = (1 + e)/u` and `1/u_(h/2) = (1 + e/2^p)/u` give, with `k` the part of `u_(h/2)` that is
`d`,

    a = b (1 - k)/(1 - b k),    b = 2^p/(2^p - 1)

and Richardson's extrapolation, `a = b`, where `k` is small. `b` is 4/3 for p = 2, as on smooth solutions, and 2 for
p = 1, as at the edges of what is held and where elements lock: `b ~ N(5/3, 0.4^2)` holds both. What is missing is not
quite of the shape of d, nor of one amount everywhere: `B` is a matrix field, affine in the position, whose coefficients
(of the unit matrices, and of positions in units of the body's root mean square radius) are independent, `N(0, 0.2^2)`.
All are estimated along with the tissue and integrated out. `s` is the displacement
within elements that is not linear between their nodes (`warpbrain.estimation.surplus`).

`d` depends on the tissue as the displacement itself does. It is taken to first order in the tissue about the estimate:
held fixed, it would make the displacement change too little with a modulus, by the share that d is of it.

A finer state is begun at that of the coarse mesh plus the difference of earlier ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.forward import Forward, State
from warpbrain.estimation.surplus import Surplus
from warpbrain.inference.beliefs import belief
from warpbrain.recordings.comparison import root_mean_square
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.mesh_error import FinerCase, restricted
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.multisecant import extrapolated
from warpbrain.simulation.sensitivity import SensitivitySolver
from warpbrain.simulation.system import System

#: Out-of-balance force of a finer state, relative: far below the error that is looked for; and of linear solves for
#: derivatives: what is left of the error is far below a standard deviation of any parameter.
ROUGH, _DERIVATIVES = 1e-5, 1e-4
#: Earlier states that are kept beside the last one.
_KEPT = 11
#: Of the range of `b` in which the error of the stiffness is finite: beyond, `a` goes on along its tangent.
_WHOLE = 0.8
#: Names of the numbers: `b`, and `B_ij` by what it is multiplied with, all without a unit.
NAMES = (
    "amount of the mesh's error",
    *(f"shape of the mesh's error {i}{j} {by}" for by, i, j in product(("even", "by x", "by y", "by z"), "xyz", "xyz")),
)


@dataclass(frozen=True)
class Discretisation:
    """What is believed of what smaller elements change: `b ~ N(mean, deviation^2)`, `B_ij ~ N(0, shape^2)`."""

    mean: float = field(default_factory=lambda: belief("mesh.amount"))
    deviation: float = field(default_factory=lambda: belief("mesh.amount_width"))
    shape: float = field(default_factory=lambda: belief("mesh.shape"))

    def __post_init__(self) -> None:
        if not math.isfinite(self.mean):
            raise InputError(f"discretisation: mean = {self.mean}: expected a finite number")
        for name, value in (("deviation", self.deviation), ("shape", self.shape)):
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"discretisation: {name} = {value}: expected a positive number")


@dataclass(frozen=True, eq=False)
class Difference:
    """The error of a mesh, as far as it shows: the state on elements of half the size less the state."""

    u: Floats  # (n, 3), at the nodes of the mesh [m]
    reactions: Floats  # (n, 3) [N]
    surplus: Surplus  # of the state on elements of half the size; linear elements have none
    theta: Floats  # (p,), where it was computed

    @property
    def size(self) -> float:
        """Root mean square over the nodes [m]."""
        return root_mean_square(self.u)

    def less(self, other: Difference) -> Difference:
        return self.plus(other.times(-1.0))

    def plus(self, other: Difference) -> Difference:
        surplus = self.surplus.plus(other.surplus)
        return Difference(self.u + other.u, self.reactions + other.reactions, surplus, self.theta)

    def times(self, factor: float) -> Difference:
        return Difference(factor * self.u, factor * self.reactions, self.surplus.times(factor), self.theta)

    def extrapolated(self, amount: float) -> Difference:
        """The whole error: `amount` times this at the nodes, and the surplus as it is (`estimation.surplus`)."""
        return replace(self.times(amount), surplus=self.surplus)


@dataclass(frozen=True, eq=False)
class DiscretisationError:
    """The error of the mesh of s states; `values` (37,) are `b` and the coefficients of `B`, ordered as `NAMES`."""

    change: Difference  # `d`: what elements of half the size change
    du: Floats  # (p, s n, 3), its derivatives by `theta`
    dR: Floats
    dsurplus: Floats  # (p, s, E, 3), derivatives by `theta` of its surplus (s, E, 3)
    basis: Floats  # (s n, 4), 1 and the position of each node from the mean, in units of the root mean square radius
    part: float  # `k`: the part of the displacement on elements of half the size that is `d`, its projection

    def amount(self, b: float) -> tuple[float, float]:
        """`a`, and its derivative by `b`."""
        k = self.part
        within = min(b, _WHOLE / k) if k > 0.0 else b
        slope = (1.0 - k) / (1.0 - within * k) ** 2
        return within * (1.0 - k) / (1.0 - within * k) + slope * (b - within), slope

    def at(self, theta: Floats, values: Floats) -> tuple[Floats, Floats]:
        """What is to be added to displacement and reactions (s n, 3)."""
        M, (u, reactions) = self._matrices(values), self._change_at(theta)
        return np.einsum("nij,nj->ni", M, u), np.einsum("nij,nj->ni", M, reactions)

    def by_theta(self, values: Floats) -> tuple[Floats, Floats]:
        """Derivatives (p, s n, 3) of that."""
        M = self._matrices(values)
        return np.einsum("nij,pnj->pni", M, self.du), np.einsum("nij,pnj->pni", M, self.dR)

    def surplus_at(self, theta: Floats) -> Surplus:
        """Surplus, of values (s, E, 3), with other parameters (p,)."""
        at, change = self.change.surplus, np.tensordot(theta - self.change.theta, self.dsurplus, axes=1)
        return replace(at, values=at.values + change)

    def by_values(self, theta: Floats, values: Floats) -> tuple[Floats, Floats]:
        """Derivatives (37, s n, 3) of that by `values`."""
        slope = self.amount(float(values[0]))[1]

        def columns(change: Floats) -> Floats:
            unit = np.einsum("nk,nj,il->kijnl", self.basis, change, np.eye(3))
            return np.concatenate([slope * change[None], unit.reshape(-1, *change.shape)])

        u, reactions = self._change_at(theta)
        return columns(u), columns(reactions)

    def _change_at(self, theta: Floats) -> tuple[Floats, Floats]:
        """`d` with other parameters (p,)."""
        step, at = theta - self.change.theta, self.change
        return at.u + np.tensordot(step, self.du, axes=1), at.reactions + np.tensordot(step, self.dR, axes=1)

    def _matrices(self, values: Floats) -> Floats:
        """`a I + B` at each node, shape (s n, 3, 3)."""
        amount = self.amount(float(values[0]))[0]
        return amount * np.eye(3) + np.einsum("nk,kij->nij", self.basis, values[1:].reshape(-1, 3, 3))


class FinerMesh:
    """Solves states of cases on elements of half the size; `solves` counts them."""

    def __init__(self, device: Any = None) -> None:
        self.solves = 0
        self._device = device
        # of earlier states: kinds of mechanisms, coarse displacements, flat, and the finer ones less those
        self._earlier: list[tuple[frozenset[str], Floats, Floats]] = []
        self._system: System | None = None
        # its mesh, its model and its displacement
        self._last: tuple[FinerCase, Model, Floats] | None = None

    def difference(
        self, case: Case, theta: Floats, system: System, u: Floats, reactions: Floats, tolerance: float = ROUGH
    ) -> Difference:
        """By how much the state of a case with the tissue of `theta` (p,) differs from that on the mesh as it is.

        That is `u` [m] and `reactions` [N] (n, 3) of a system; `tolerance` is the out-of-balance force of the finer
        state, relative. `SolveError` if there is none.
        """
        self.solves += 1
        finer = FinerCase(case)
        model = finer.model(system.model)
        external = model.external_forces()
        finer_system = self._system_of(model)
        # the loads act already: one load step, or the state is taken not to exist there
        options = EquilibriumOptions(tolerance=tolerance, max_total_newton=EquilibriumOptions.max_newton)
        solver = EquilibriumSolver(finer_system, options)
        flat = finer.prolongation @ u
        acting = frozenset(mechanism.kind for mechanism in case.mechanisms)
        # the error at the edges of another mechanism would nearly invert elements
        earlier = [(at, difference) for kinds, at, difference in self._earlier if kinds <= acting]
        start = flat + extrapolated(earlier, u.ravel()) if earlier else flat
        try:
            solution = solver.solve(external, start)
        except SolveError:
            if not earlier:
                raise
            solution = solver.solve(external, flat)
        self._earlier = [*self._earlier[-_KEPT:], (acting, u.ravel(), solution.u - flat)]
        self._last = finer, model, solution.u
        finer_u, finer_reactions = restricted(
            finer.prolongation, solution.u, model.reactions(solution.internal, external)
        )
        return Difference(finer_u - u, finer_reactions - reactions, Surplus.of(finer.edges, solution.u), theta)

    def derivatives(
        self, theta: Floats, materials: Callable[[Floats], Mapping[int, Material]]
    ) -> tuple[Floats, Floats, Floats]:
        """Derivatives of the last state there by parameters (p,).

        `materials` are those of parameters by label. Returns displacement and reactions (p, n, 3) at the nodes of the
        mesh, and surplus (p, E, 3). `SolveError` if the state is unstable.
        """
        assert self._system is not None and self._last is not None
        finer, model, u = self._last
        solver = SensitivitySolver(self._system, _DERIVATIVES)
        sensitivities = solver.solve(u, lambda at: model.with_materials(materials(at)), theta)
        each = zip(sensitivities.u, sensitivities.reactions, strict=True)
        du, dR = map(np.array, zip(*(restricted(finer.prolongation, *one) for one in each), strict=True))
        return du, dR, Surplus.of(finer.edges, np.asarray(sensitivities.u)).values

    def _system_of(self, model: Model) -> System:
        """The system of the last state with other parameters, or a new one if more than parameters changed."""
        if self._system is not None:
            try:
                self._system.set_model(model)
                return self._system
            except InputError:
                # there need not be room for both
                self._system = None
        self._system = System(model, self._device)
        return self._system


def discretisation_error(
    finer: Sequence[FinerMesh], forward: Forward, state: State, derivatives: tuple[Floats, Floats]
) -> DiscretisationError:
    """The error of s states, to first order in the parameters; `derivatives` (p, s n, 3) of u and reactions by these.

    `SolveError` if there is no stable equilibrium on a finer mesh.
    """
    theta, parameters, count = state.theta, forward.parameters, len(forward.states)
    errors, by_theta = [], []
    pairs = zip(np.split(state.u, count), np.split(state.reactions, count), strict=True)
    try:
        for mesh, solver, (u, R) in zip(finer, forward.states, pairs, strict=True):
            errors.append(mesh.difference(parameters.applied(solver.case, theta), theta, solver.system, u, R))
            by_theta.append(mesh.derivatives(theta, parameters.materials))
    except SolveError as failure:
        raise SolveError(
            f"the error of the mesh is not known: on elements of half the size {failure}; it can be left out, and "
            "then the estimate holds for this mesh only"
        ) from None
    u, reactions = (np.concatenate([getattr(error, name) for error in errors]) for name in ("u", "reactions"))
    du, dR = (np.concatenate([each[k] for each in by_theta], axis=1) for k in (0, 1))
    dsurplus = np.stack([each[2] for each in by_theta], axis=1)
    surplus = replace(errors[0].surplus, values=np.stack([error.surplus.values for error in errors]))
    there = state.u + u
    part = float(np.vdot(u, there)) / max(float(np.vdot(there, there)), 1e-300)
    points = forward.case.remaining[0].points
    away = points - points.mean(axis=0)
    basis = np.tile(np.column_stack([np.ones(len(away)), away / root_mean_square(away)]), (count, 1))
    change = Difference(u, reactions, surplus, theta)
    return DiscretisationError(change, du - derivatives[0], dR - derivatives[1], dsurplus, basis, part)
