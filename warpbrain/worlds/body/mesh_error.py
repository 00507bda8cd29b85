"""The error of the mesh under a hypothesis: the state on elements of half the size, less the state.

Linear tetrahedra are too stiff, and to a different degree for each mechanism: of a pressure in a cavity a coarse mesh
loses far more than of weight. So the error is computed with the mechanism that is fitted, whose size would be wrong
by as much otherwise. It also depends on the tissue: on stiffness as the displacement does, but not uniformly, and on
compressibility more than the displacement does. The columns of stiffness and compressibility include these changes, or
a tenth more stiffness would be taken for something that is missing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.discretisation import Difference, Discretisation
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.kernels.linear import ConjugateGradient
from warpbrain.kernels.two_level import TwoLevelGradient
from warpbrain.physics.proposal import Proposal
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.extrapolated import extrapolated
from warpbrain.simulation.finer import FinerCase, free_prolongation, restricted
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System
from warpbrain.worlds.body.factors import Factors
from warpbrain.worlds.body.sensors import Sensors
from warpbrain.worlds.body.states import TOLERANCE, Hypothesis, SolvedState, States

#: Out-of-balance force of the finer state, relative: far below the error that is looked for, and where nothing is
#: derived from it, still a hundredth of that which the state of the coarser mesh has there.
_ROUGH, ENOUGH = 10.0 * TOLERANCE, 1e-3
#: Iterations of conjugate gradients at most, where the two levels are of no help.
_MOST = 10_000
#: Earlier states that are kept beside the last one.
_KEPT = 11
#: Change of the tissue [standard deviations] whose error is compared: far more than rounding, little beside the error.
_STEP = 0.2


@dataclass(frozen=True, eq=False)
class MeshErrors:
    """The error of the mesh at a state, and how it changes.

    Attributes
    ----------
    error : Difference
        At that state.
    volume : float
        `volume_of` the tissue there.
    by_volume : Difference
        Its derivative by that.
    by_tissue : tuple of Difference
        Its derivative by each standard normal coordinate of the tissues' prior.
    finer : FinerStates
        Which compute it at other states.
    """

    error: Difference
    volume: float
    by_volume: Difference
    by_tissue: tuple[Difference, ...]
    finer: FinerStates

    def with_tissue(self, theta: Floats, volume: float, prior: Gaussian) -> Difference:
        """The error with other tissue (p,) of another `volume_of`, without the share of mechanisms."""
        error = self.error
        for z, change in zip(np.linalg.solve(prior.factor, theta - error.theta), self.by_tissue, strict=True):
            error = error.plus(change.times(float(z)))
        return error if volume == self.volume else error.plus(self.by_volume.times(volume - self.volume))

    def of(self, hypothesis: Hypothesis, prior: Gaussian) -> Difference:
        """The error that the tissue of a hypothesis has, to first order."""
        return self.with_tissue(hypothesis.theta, volume_of(self.finer.states.materials(hypothesis)), prior)


def volume_of(materials: Mapping[int, Material]) -> float:
    """`-ln(1 - 2 nu)` in the mean of tissues: nearly the logarithm of bulk over shear moduli."""
    return -float(np.mean([math.log1p(-2.0 * material.poisson) for material in materials.values()]))


def expected(known: Difference) -> Difference:
    """The whole error of a mesh, of which elements of half the size show a part."""
    return known.times(Discretisation().mean)


def expected_answer(sensors: Sensors, known: Difference) -> Floats:
    """Response (n,) of the sensors to the whole error."""
    change = expected(known)
    return sensors.answer(change.u, change.reactions)


class FinerStates:
    """Solves hypotheses on elements of half the size, begun at the coarse state plus the error of earlier ones.

    On the CPU the factorised stiffness of the coarse mesh preconditions them: see `warpbrain.kernels.two_level`. It is
    factorised anew when it helps less.

    Parameters
    ----------
    states : States
    """

    def __init__(self, states: States) -> None:
        self.states = states
        # of earlier states: kinds of mechanisms, coarse displacements, flat, and the finer ones less those
        self._earlier: list[tuple[frozenset[str], Floats, Floats]] = []
        self._system: System | None = None
        self._factors: tuple[Factors, Bools] | None = None
        # solver of the system with these factors
        self._linear: TwoLevelGradient | None = None

    def errors(self, state: SolvedState, volume: Proposal, prior: Gaussian) -> MeshErrors:
        """The error of a state, and its derivatives by the tissue.

        Parameters
        ----------
        state : SolvedState
        volume : Proposal
            Tissue that is more or less compressible, by its `volume_of`.
        prior : Gaussian
            Of the tissues' parameters.

        Raises
        ------
        SolveError
            If there is no equilibrium on the finer mesh.
        """
        error, hypothesis = self.error(state.hypothesis, state), state.hypothesis
        less_compressible = volume.make(volume.mean + volume.sd)
        other = self.error(replace(hypothesis, mechanisms=(*hypothesis.mechanisms, less_compressible)), state)
        by_tissue = []
        for axis in prior.factor.T:
            shifted = self.error(replace(hypothesis, theta=hypothesis.theta + _STEP * axis), state)
            by_tissue.append(shifted.less(error).times(1.0 / _STEP))
        by_volume = other.less(error).times(1.0 / float(volume.sd[0]))
        return MeshErrors(error, volume_of(self.states.materials(hypothesis)), by_volume, tuple(by_tissue), self)

    def error(self, hypothesis: Hypothesis, nearby: SolvedState, tolerance: float = _ROUGH) -> Difference:
        """The error of a hypothesis with a uniform stiffness within tissues, on which it hardly depends.

        Parameters
        ----------
        hypothesis : Hypothesis
        nearby : SolvedState
            A state near to it.
        tolerance : float
            Out-of-balance force of the finer state, relative.

        Raises
        ------
        SolveError
            If there is no equilibrium on the finer mesh.
        """
        uniform = replace(hypothesis, field=np.zeros_like(hypothesis.field))
        coarse = self.states.solve(uniform, nearby.u)
        finer = FinerCase(self.states.case_of(uniform))
        model = finer.model(coarse.system.model)
        external = model.external_forces()
        system = self._system_of(model)
        linear = self._two_level(system, coarse, finer.prolongation)
        solver = EquilibriumSolver(system, EquilibriumOptions(tolerance=tolerance), linear=linear)
        flat = finer.prolongation @ coarse.u
        acting = frozenset(mechanism.kind for mechanism in uniform.mechanisms)
        # the error at the edges of another mechanism would nearly invert elements
        earlier = [(u, difference) for kinds, u, difference in self._earlier if kinds <= acting]
        start = flat + extrapolated(earlier, coarse.u.ravel()) if earlier else flat
        try:
            solution = solver.solve(external, start)
        except SolveError:
            solution = solver.solve(external, flat)
        if linear is not None and linear.slow:
            self._factors = self._linear = None
        self._earlier = [*self._earlier[-_KEPT:], (acting, coarse.u.ravel(), solution.u - flat)]
        u, reactions = restricted(finer.prolongation, solution.u, model.reactions(solution.internal, external))
        return Difference(u - coarse.u, reactions - coarse.reactions, hypothesis.theta)

    def _two_level(self, system: System, coarse: SolvedState, prolongation: Any) -> TwoLevelGradient | None:
        """A solver of the finer system with the factors of the coarse one; None for the system's own solver.

        That is needed for terms with unknowns of their own, and for midside nodes, which the coarse mesh has not.
        """
        if not system.device.is_cpu or system.quadratic is not None:
            return None
        if self._linear is not None:
            return self._linear
        plain = system.linear_solver(tolerance=_ROUGH, max_iterations=_MOST, watch_curvature=True)
        if not isinstance(plain, ConjugateGradient):
            return None
        if self._factors is None:
            coarse.system.u.assign(coarse.u)
            free = ~coarse.system.model.constrained.ravel()
            try:
                self._factors = Factors(coarse.system.stiffness().tocsr()[free][:, free]), free
            except SolveError:
                return None
        factors, free = self._factors
        prolong = free_prolongation(prolongation, free, system.model.constrained)
        self._linear = TwoLevelGradient(plain, system.load, system.solution, factors, prolong, tolerance=_ROUGH)
        return self._linear

    def _system_of(self, model: Model) -> System:
        """The system of the last state with other parameters, or a new one if more than parameters changed."""
        if self._system is not None:
            try:
                self._system.set_model(model)
                return self._system
            except InputError:
                pass
        self._system, self._linear = System(model, self.states.device), None
        return self._system
