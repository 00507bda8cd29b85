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

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.finer_mesh import ROUGH, Difference, Discretisation, FinerMesh
from warpbrain.estimation.parameters import Gaussian
from warpbrain.physics.proposal import Proposal
from warpbrain.simulation.model import Material
from warpbrain.worlds.body.sensors import Sensors
from warpbrain.worlds.body.states import Hypothesis, SolvedState, States

#: Out-of-balance force of the finer state, relative, where nothing is derived from it: still a hundredth of that which
#: the state of the coarser mesh has there.
ENOUGH = 1e-3
#: Change of the tissue [standard deviations] whose error is compared: far more than rounding, little beside the error.
_STEP = 0.2
#: Least change of the tissue [standard deviations] by which derivatives are updated: the difference of nearer errors
#: may be that of out-of-balance forces.
_APART = 0.02


@dataclass(frozen=True, eq=False)
class MeshErrors:
    """The error of the mesh at a state, and how it changes."""

    error: Difference  # at that state
    volume: float  # `volume_of` the tissue there
    by_volume: Difference  # its derivative by that
    by_tissue: tuple[Difference, ...]  # its derivative by each standard normal coordinate of the tissues' prior
    finer: FinerStates  # which compute it at other states

    def with_tissue(self, theta: Floats, volume: float, prior: Gaussian) -> Difference:
        """The error with other tissue (p,) of another `volume_of`, without the share of mechanisms."""
        error = self.error
        for z, change in zip(np.linalg.solve(prior.factor, theta - error.theta), self.by_tissue, strict=True):
            error = error.plus(change.times(float(z)))
        return error if volume == self.volume else error.plus(self.by_volume.times(volume - self.volume))

    def with_error(self, error: Difference, prior: Gaussian) -> MeshErrors:
        """Linear about the tissue of an error that was computed anew.

        The derivatives by the tissue take Broyden's rank-one update (1965), by which both errors are met. Near the
        collapse of a body its error may double where tissue is a tenth softer, and fits that kept the derivatives at
        the base would alternate between two states.
        """
        moved = np.linalg.solve(prior.factor, error.theta - self.error.theta)
        squared = float(moved @ moved)
        if squared < _APART**2:
            return replace(self, error=error)
        excess = error.less(self.with_tissue(error.theta, self.volume, prior)).times(1.0 / squared)
        by_tissue = (change.plus(excess.times(z)) for z, change in zip(moved.tolist(), self.by_tissue, strict=True))
        return replace(self, error=error, by_tissue=tuple(by_tissue))

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
    return sensors.share * sensors.answer(change.u, change.reactions)


class FinerStates:
    """The error of the mesh of states under hypotheses."""

    def __init__(self, states: States) -> None:
        self.states = states
        self._finer = FinerMesh(states.device)

    def release(self) -> None:
        """Let go of the finer mesh and of all that was computed on it; a further error makes them anew."""
        self._finer = FinerMesh(self.states.device)

    def errors(self, state: SolvedState, volume: Proposal, prior: Gaussian) -> MeshErrors:
        """The error of a state, and its derivatives by the tissue and by its `volume_of`; `SolveError` as `error`."""
        error, hypothesis = self.error(state.hypothesis, state), state.hypothesis
        less_compressible = volume.make(volume.mean + volume.sd)
        other = self.error(replace(hypothesis, mechanisms=(*hypothesis.mechanisms, less_compressible)), state)
        by_tissue = []
        for axis in prior.factor.T:
            shifted = self.error(replace(hypothesis, theta=hypothesis.theta + _STEP * axis), state)
            by_tissue.append(shifted.less(error).times(1.0 / _STEP))
        by_volume = other.less(error).times(1.0 / float(volume.sd[0]))
        return MeshErrors(error, volume_of(self.states.materials(hypothesis)), by_volume, tuple(by_tissue), self)

    def error(self, hypothesis: Hypothesis, nearby: SolvedState, tolerance: float = ROUGH) -> Difference:
        """The error of a hypothesis with a uniform stiffness within tissues, on which it hardly depends.

        `nearby`: a state near to it. `tolerance`: out-of-balance force of the finer state, relative. `SolveError` if
        there is no equilibrium on the finer mesh.
        """
        uniform = replace(hypothesis, field=np.zeros_like(hypothesis.field))
        coarse = self.states.solve(uniform, nearby.u)
        case = self.states.case_of(uniform)
        return self._finer.difference(case, uniform.theta, coarse.system, coarse.u, coarse.reactions, tolerance)
