"""The error of the mesh under a hypothesis: the state on elements of half the size, less the state.

Linear tetrahedra answer too little, and to each mechanism in its own measure: a pressure in a cavity moves a coarse
mesh far less than weight does. So the error is computed with the mechanism that is fitted, not once for all: otherwise
its size would come out wrong by as much. And it changes with the tissue: with its stiffness as the displacement does,
but not alike everywhere, and as it is less compressible by more than the displacement itself. What stiffness and
compressibility may explain has these changes, or a tenth more stiffness would be taken for something that is missing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

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

Floats = NDArray[np.float64]

#: Out-of-balance force of the finer state, relative: far below the error that is looked for, and where nothing is
#: derived from it, still a hundredth of that which the state of the coarser mesh has there.
_ROUGH, _ENOUGH = 10.0 * TOLERANCE, 1e-3
#: Iterations of conjugate gradients at most, where the two levels are of no help.
_MOST = 10_000
#: States that are remembered beside the last one.
_KEPT = 11
#: Change of the tissue [standard deviations] whose error is compared: far more than rounding, little beside the error.
_STEP = 0.2


@dataclass(frozen=True, eq=False)
class MeshErrors:
    """The error of the mesh at a state, and how it changes.

    Attributes
    ----------
    own : Difference
    volume : float
        `volume_of` the tissue there.
    by_volume : Difference
        What it gains for each unit of that.
    by_tissue : tuple of Difference
        What one standard deviation of each coordinate of the tissues' prior adds to it.
    finer : FinerStates
        Which finds it at other states.
    """

    own: Difference
    volume: float
    by_volume: Difference
    by_tissue: tuple[Difference, ...]
    finer: FinerStates

    def with_tissue(self, theta: Floats, volume: float, prior: Gaussian) -> Difference:
        """The error with other tissue (p,) of another `volume_of`, without what belongs to a mechanism beside."""
        found = self.own
        for z, change in zip(np.linalg.solve(prior.factor, theta - found.theta), self.by_tissue, strict=True):
            found = found.plus(change.times(float(z)))
        return found if volume == self.volume else found.plus(self.by_volume.times(volume - self.volume))

    def of(self, hypothesis: Hypothesis, prior: Gaussian) -> Difference:
        """The error that the tissue of a hypothesis is known to have."""
        return self.with_tissue(hypothesis.theta, volume_of(self.finer.states.materials(hypothesis)), prior)


def volume_of(materials: Mapping[int, Material]) -> float:
    """`-ln(1 - 2 nu)` in the mean of tissues: even steps of it are even steps of the logarithm of bulk moduli."""
    return -float(np.mean([math.log1p(-2.0 * material.poisson) for material in materials.values()]))


def expected(known: Difference) -> Difference:
    """The whole error of a mesh, of which elements of half the size show a part."""
    return known.times(Discretisation().mean)


def expected_answer(sensors: Sensors, known: Difference) -> Floats:
    """What the whole error changes (n,) of what is recorded."""
    change = expected(known)
    return sensors.answer(change.u, change.reactions)


class FinerStates:
    """Solves hypotheses on elements of half the size, each from what others near to it were beyond their mesh.

    On the CPU the mesh that there was, factorised at the first of them, preconditions all of them: see
    `warpbrain.kernels.two_level`. It is factorised anew when it helps less, and for a fit of other mechanisms.

    Parameters
    ----------
    states : States
    """

    def __init__(self, states: States) -> None:
        self.states = states
        # kinds of mechanisms that acted, displacements that were found, flat, and what the finer ones were beyond them
        self._beyond: list[tuple[frozenset[str], Floats, Floats]] = []
        self._system: System | None = None
        self._factors: tuple[Factors, NDArray[np.bool_]] | None = None
        self._sharing: frozenset[str] = frozenset()
        # of the system and the factors that there are
        self._linear: TwoLevelGradient | None = None

    def errors(self, state: SolvedState, volume: Proposal, prior: Gaussian) -> MeshErrors:
        """The error of a state, and what it is beside that with other tissue.

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
        own, here = self.error(state.hypothesis, state), state.hypothesis
        less_compressible = volume.make(volume.mean + volume.sd)
        other = self.error(replace(here, mechanisms=(*here.mechanisms, less_compressible)), state)
        by_tissue = []
        for axis in prior.factor.T:
            beside = self.error(replace(here, theta=here.theta + _STEP * axis), state)
            by_tissue.append(beside.less(own).times(1.0 / _STEP))
        by_volume = other.less(own).times(1.0 / float(volume.sd[0]))
        return MeshErrors(own, volume_of(self.states.materials(here)), by_volume, tuple(by_tissue), self)

    def of_fit(self, hypothesis: Hypothesis, near: SolvedState) -> Difference:
        """The `error` of a fit with mechanisms, from which nothing is derived."""
        acting = frozenset(mechanism.kind for mechanism in hypothesis.mechanisms)
        if acting != self._sharing:
            # factors of a state without them are of little help where they act
            self._factors = self._linear = None
        self._sharing = acting
        return self.error(hypothesis, near, _ENOUGH)

    def error(self, hypothesis: Hypothesis, near: SolvedState, tolerance: float = _ROUGH) -> Difference:
        """The error of a hypothesis without its stiffness field, which it hardly depends on.

        Parameters
        ----------
        hypothesis : Hypothesis
        near : SolvedState
            A state near to it.
        tolerance : float
            Out-of-balance force of the finer state, relative.

        Raises
        ------
        SolveError
            If there is no equilibrium on the finer mesh.
        """
        even = replace(hypothesis, field=np.zeros_like(hypothesis.field))
        coarse = self.states.solve(even, near.u)
        finer = FinerCase(self.states.case_of(even))
        model = finer.model(coarse.system.model)
        external = model.external_forces()
        system = self._system_of(model)
        linear = self._two_level(system, coarse, finer.prolongation)
        solver = EquilibriumSolver(system, EquilibriumOptions(tolerance=tolerance), linear=linear)
        flat = finer.prolongation @ coarse.u
        acting = frozenset(mechanism.kind for mechanism in even.mechanisms)
        # what another mechanism has at its edges is not here: begun from that, elements are nearly inside out
        alike = [(u, beyond) for kinds, u, beyond in self._beyond if kinds <= acting]
        begin = flat + extrapolated(alike, coarse.u.ravel()) if alike else flat
        try:
            found = solver.solve(external, begin)
        except SolveError:
            found = solver.solve(external, flat)
        if linear is not None and linear.slow:
            self._factors = self._linear = None
        self._beyond = [*self._beyond[-_KEPT:], (acting, coarse.u.ravel(), found.u - flat)]
        u, reactions = restricted(finer.prolongation, found.u, model.reactions(found.internal, external))
        return Difference(u - coarse.u, reactions - coarse.reactions, hypothesis.theta)

    def _two_level(self, system: System, coarse: SolvedState, prolongation: Any) -> TwoLevelGradient | None:
        """What solves the finer system's linear systems with the factors of the coarse one; None for what does always.

        Terms with unknowns of their own, and midside nodes, which are not on the mesh of corners, are for that one.
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
        """The system of the last state with other numbers, or another one where numbers are not all that changed."""
        if self._system is not None:
            try:
                self._system.set_model(model)
                return self._system
            except InputError:
                pass
        self._system, self._linear = System(model, self.states.device), None
        return self._system
