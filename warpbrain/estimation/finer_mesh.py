"""States on elements of half the size, and by how much they differ: the one error of the mesh of fits and diagnoses.

A state is begun at that of the coarse mesh plus the difference of earlier ones. On the CPU the factorised stiffness of
the coarse mesh preconditions it (`warpbrain.kernels.two_level`); it is factorised anew when it helps less.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.cases.case import Case
from warpbrain.errors import InputError, SolveError
from warpbrain.kernels.linear import ConjugateGradient
from warpbrain.kernels.two_level import TwoLevelGradient
from warpbrain.recordings.agreement import root_mean_square
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.extrapolated import extrapolated
from warpbrain.simulation.finer import FinerCase, free_prolongation, restricted
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.sensitivity import SensitivitySolver
from warpbrain.simulation.sparse_factors import SparseFactors
from warpbrain.simulation.system import System

#: Out-of-balance force of a finer state, relative: far below the error that is looked for; and of linear solves for
#: derivatives: what is left of the error is far below a standard deviation of any parameter.
ROUGH, _DERIVATIVES = 1e-5, 1e-4
#: Iterations of conjugate gradients at most, where the two levels are of no help.
_MOST = 10_000
#: Earlier states that are kept beside the last one.
_KEPT = 11


@dataclass(frozen=True, eq=False)
class Difference:
    """The error of a mesh, as far as it shows.

    Attributes
    ----------
    u, reactions : (n, 3) array
        Of the state on elements of half the size less the state, at the nodes of the mesh [m] and [N].
    theta : (p,) array
        Where it was computed.
    """

    u: Floats
    reactions: Floats
    theta: Floats

    @property
    def size(self) -> float:
        """Root mean square over the nodes [m]."""
        return root_mean_square(self.u)

    def less(self, other: Difference) -> Difference:
        """By how much it is more than another."""
        return Difference(self.u - other.u, self.reactions - other.reactions, self.theta)

    def plus(self, other: Difference) -> Difference:
        """Both together."""
        return Difference(self.u + other.u, self.reactions + other.reactions, self.theta)

    def times(self, factor: float) -> Difference:
        """So many times as large."""
        return Difference(factor * self.u, factor * self.reactions, self.theta)


class FinerMesh:
    """Solves states of cases on elements of half the size.

    Parameters
    ----------
    device : str, optional

    Attributes
    ----------
    solves : int
        Equilibria on that mesh.
    """

    def __init__(self, device: Any = None) -> None:
        self.solves = 0
        self._device = device
        # of earlier states: kinds of mechanisms, coarse displacements, flat, and the finer ones less those
        self._earlier: list[tuple[frozenset[str], Floats, Floats]] = []
        self._system: System | None = None
        self._factors: tuple[Any, Bools] | None = None
        # solver of the system with these factors
        self._linear: TwoLevelGradient | None = None
        self._last: tuple[FinerCase, Model, Floats] | None = None

    def difference(
        self, case: Case, theta: Floats, system: System, u: Floats, reactions: Floats, tolerance: float = ROUGH
    ) -> Difference:
        """By how much the state of a case differs from that on the mesh as it is.

        Parameters
        ----------
        case : Case
            With the tissue of `theta` (p,).
        theta : (p,) array
        system : System
            Of the case; its displacement is the state's afterwards.
        u, reactions : (n, 3) array
            The state on the mesh as it is [m] and [N].
        tolerance : float
            Out-of-balance force of the finer state, relative.

        Raises
        ------
        SolveError
            If there is no equilibrium on the finer mesh.
        """
        self.solves += 1
        finer = FinerCase(case)
        model = finer.model(system.model)
        external = model.external_forces()
        finer_system = self._system_of(model)
        linear = self._two_level(finer_system, system, u, finer.prolongation)
        solver = EquilibriumSolver(finer_system, EquilibriumOptions(tolerance=tolerance), linear=linear)
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
        if linear is not None and linear.slow:
            self._factors = self._linear = None
        self._earlier = [*self._earlier[-_KEPT:], (acting, u.ravel(), solution.u - flat)]
        self._last = finer, system.model, solution.u
        finer_u, finer_reactions = restricted(
            finer.prolongation, solution.u, model.reactions(solution.internal, external)
        )
        return Difference(finer_u - u, finer_reactions - reactions, theta)

    def derivatives(
        self, theta: Floats, materials: Callable[[Floats], Mapping[int, Material]]
    ) -> tuple[Floats, Floats]:
        """Derivatives (p, n, 3) of the last state there, its displacement and its reactions at the nodes of the mesh.

        Parameters
        ----------
        theta : (p,) array
        materials : callable
            From parameters (p,) to materials by label.

        Raises
        ------
        SolveError
            If the state is unstable.
        """
        assert self._system is not None and self._last is not None
        finer, coarse, u = self._last
        by_theta = SensitivitySolver(self._system, _DERIVATIVES).solve(
            u, lambda at: finer.model(coarse, materials(at)), theta
        )
        pairs = zip(by_theta.u, by_theta.reactions, strict=True)
        each = [restricted(finer.prolongation, du, dR) for du, dR in pairs]
        return np.array([du for du, _ in each]), np.array([dR for _, dR in each])

    def _two_level(self, system: System, coarse: System, u: Floats, prolongation: Any) -> TwoLevelGradient | None:
        """A solver of the finer system with the factors of the coarse one; None for the system's own solver.

        That is needed for terms with unknowns of their own, and for midside nodes, which the coarse mesh has not.
        """
        if not system.device.is_cpu or system.quadratic is not None:
            return None
        if self._linear is not None:
            return self._linear
        plain = system.linear_solver(tolerance=ROUGH, max_iterations=_MOST, watch_curvature=True)
        if not isinstance(plain, ConjugateGradient):
            return None
        if self._factors is None:
            coarse.u.assign(u)
            free = ~coarse.model.constrained.ravel()
            try:
                self._factors = SparseFactors(coarse.stiffness().tocsr()[free][:, free]), free
            except RuntimeError:
                return None
        factors, free = self._factors
        prolong = free_prolongation(prolongation, free, system.model.constrained)
        self._linear = TwoLevelGradient(plain, system.load, system.solution, factors, prolong, tolerance=ROUGH)
        return self._linear

    def _system_of(self, model: Model) -> System:
        """The system of the last state with other parameters, or a new one if more than parameters changed."""
        if self._system is not None:
            try:
                self._system.set_model(model)
                return self._system
            except InputError:
                pass
        self._system, self._linear = System(model, self._device), None
        return self._system
