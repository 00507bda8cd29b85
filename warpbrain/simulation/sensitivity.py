"""How an equilibrium changes with the parameters of its laws: the implicit function theorem.

At equilibrium `f_int(u, theta) = f_ext` on the free components, whatever `theta` is, and the constrained ones do not
move. Loads are dead and know nothing of the laws. Hence, with the tangent stiffness `K` at `u`,

    K du/dtheta = -df_int/dtheta |_u           on the free components
    dR/dtheta = df_int/dtheta |_u + K du/dtheta    on the constrained ones, of the reactions `R`

`df_int/dtheta` at fixed `u` is a five-point difference of the internal forces in `theta`. Forces are smooth in the
parameters of every law (linear in the moduli), so with a step of `epsilon^(1/5)` it is exact to some 1e-12 in double
precision, and no law has to know its derivatives.

Every parameter is one more right-hand side of one matrix, and conjugate gradients solve for all of them at once
(`warpbrain.kernels.block_linear`). SciPy's sparse LU takes 1.1 s for its factors on the phantom's 4187 nodes (2-core
CPU, 2026-11), longer than two parameters take so to 1e-10; it has no device, and its fill grows faster than the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.errors import SolveError
from warpbrain.kernels.block_linear import BlockConjugateGradient
from warpbrain.kernels.linear import LinearResult
from warpbrain.simulation.equilibrium import Equilibrium
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]

#: What a vector of parameters means: the material of each tissue, by label.
MaterialsOf = Callable[[Floats], Mapping[int, Material]]

#: Weights of the values at -2, -1, 1 and 2 steps in the derivative; its error is `h^4 f^(5) / 30`.
_STENCIL = {-2: 1.0 / 12.0, -1: -8.0 / 12.0, 1: 8.0 / 12.0, 2: -1.0 / 12.0}


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of an equilibrium by p parameters.

    Attributes
    ----------
    u : (p, n, 3) array
        Of the displacement [m per unit of the parameter]; zero on constrained components.
    reactions : (p, n, 3) array
        Of what holds the constrained components [N per unit]; zero elsewhere.
    cg_iterations : tuple of p ints
    """

    u: Floats
    reactions: Floats
    cg_iterations: tuple[int, ...]


class SensitivitySolver:
    """Differentiates equilibria of one pre-processed model; what it needs is made once.

    Parameters
    ----------
    system : System
    tolerance : float
        Relative, of the linear solves; in single precision it is no smaller than rounding allows.
    max_cg : int
        Iterations of one of them.
    """

    def __init__(self, system: System, tolerance: float = 1e-10, max_cg: int = 10_000) -> None:
        self.system = system
        self._step = system.precision.epsilon**0.2
        self._tolerance = max(tolerance, 20.0 * system.precision.epsilon)
        self._max_cg = max_cg
        self._solvers: dict[int, BlockConjugateGradient] = {}

    def solve(self, u: ArrayLike, materials: MaterialsOf, theta: ArrayLike) -> Sensitivities:
        """Derivatives by each parameter.

        The system has the materials of `theta` and the displacement `u` when this returns.

        Parameters
        ----------
        u : (n, 3) array
            Displacement [m], in equilibrium under the materials of `theta`.
        materials : callable
            From parameters (p,) to materials by tissue label; smooth, and defined a little around `theta`.
        theta : (p,) array

        Raises
        ------
        SolveError
            If the equilibrium is unstable, so that it has no derivative, or a linear solve does not converge; or if it
            is that of a step in which unknowns of a term's own follow the displacement.
        """
        system = self.system
        if any(term.coupled for term in system.terms):
            raise SolveError("sensitivity: fluid flows in this step, and only a steady state has derivatives yet")
        point = np.asarray(theta, dtype=np.float64)
        constrained = system.model.constrained
        system.u.assign(np.asarray(u, dtype=np.float64))
        at_fixed_u = [self._force_derivative(materials, point, k) for k in range(len(point))]
        system.set_materials(materials(point))
        system.evaluate_tangents()
        system.assemble(k=1.0, m=0.0)
        if not len(point):
            none = np.zeros((0, system.size, 3))
            return Sensitivities(none, none, ())
        solver = self._solver(len(point))
        solver.prepare()
        solved = solver.solve([np.where(constrained, 0.0, -force) for force in at_fixed_u])
        results = solver.results()
        for k, linear in enumerate(results):
            _require_solved(linear, k)
        moved = np.where(constrained, 0.0, solved)
        reactions = [
            np.where(constrained, force + system.stiffness_times(du), 0.0)
            for force, du in zip(at_fixed_u, moved, strict=True)
        ]
        return Sensitivities(moved, np.array(reactions), tuple(linear.iterations for linear in results))

    def _solver(self, count: int) -> BlockConjugateGradient:
        if count not in self._solvers:
            system = self.system
            self._solvers[count] = BlockConjugateGradient(
                system.matrix,
                system.diagonal,
                count,
                system.precision,
                tolerance=self._tolerance,
                max_iterations=self._max_cg,
            )
        return self._solvers[count]

    def _force_derivative(self, materials: MaterialsOf, theta: Floats, k: int) -> Floats:
        """`df_int/dtheta_k` at fixed `u`, shape (n, 3)."""
        system = self.system
        # one over a small exponent of Ogden's law is a modulus: a step must not come near to its sign
        step = self._step * min(1.0, abs(theta[k])) if theta[k] else self._step
        total = np.zeros((system.size, 3))
        for distance, weight in _STENCIL.items():
            beside = theta.copy()
            beside[k] += distance * step
            system.set_materials(materials(beside))
            system.evaluate_forces()
            system.gather_forces()
            total += weight * system.internal.numpy()
        return total / step


def sensitivities(
    system: System, equilibrium: Equilibrium, materials: MaterialsOf, theta: ArrayLike, tolerance: float = 1e-10
) -> Sensitivities:
    """Derivatives of an equilibrium by parameters of its laws; see `SensitivitySolver`."""
    return SensitivitySolver(system, tolerance).solve(equilibrium.u, materials, theta)


def _require_solved(linear: LinearResult, parameter: int) -> None:
    if linear.indefinite:
        raise SolveError(
            f"sensitivity to parameter {parameter}: the tangent stiffness is indefinite (curvature "
            f"{linear.curvature:.2e} N/m): the equilibrium is unstable, and does not change smoothly with its laws"
        )
    if not linear.converged:
        raise SolveError(
            f"sensitivity to parameter {parameter}: conjugate gradients did not converge in {linear.iterations} "
            f"iterations (residual {linear.residual:.1e}, goal {linear.tolerance:.1e})"
        )
