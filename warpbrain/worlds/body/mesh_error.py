"""The error of the mesh under a hypothesis: the state on elements of half the size, less the state.

Linear tetrahedra are too stiff, and to a different degree for each mechanism: of a pressure in a cavity a coarse mesh
loses far more than of weight. So the error is computed with the mechanism that is fitted, whose size would be wrong
by as much otherwise. It also depends on the tissue, on stiffness as the displacement does, but not uniformly: columns
of stiffness include these changes, or a tenth more of it would be taken for something that is missing.

How it depends on compressibility is left to the share of a mechanism that says another one. Its derivative at the base
is several times too large or too small about another state where the body is near to giving way, and what tissue that
is less compressible than declared does there would be taken for a fluid in its pores.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.finer_mesh import ROUGH, Difference, Discretisation, FinerMesh
from warpbrain.estimation.parameters import Gaussian
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
    by_tissue: tuple[Difference, ...]  # its derivative by each standard normal coordinate of the tissues' prior
    finer: FinerStates  # which compute it at other states

    def of(self, theta: Floats, prior: Gaussian) -> Difference:
        """The error of other tissue (p,), to first order, without the share of mechanisms."""
        error = self.error
        for z, change in zip(np.linalg.solve(prior.factor, theta - error.theta), self.by_tissue, strict=True):
            error = error.plus(change.times(float(z)))
        return error

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
        excess = error.less(self.of(error.theta, prior)).times(1.0 / squared)
        by_tissue = (change.plus(excess.times(z)) for z, change in zip(moved.tolist(), self.by_tissue, strict=True))
        return replace(self, error=error, by_tissue=tuple(by_tissue))


def expected(known: Difference) -> Difference:
    """The whole error of a mesh, of which elements of half the size show a part."""
    return known.extrapolated(Discretisation().mean)


def expected_answer(sensors: Sensors, known: Difference) -> Floats:
    """Response (n,) of the sensors to the whole error."""
    change = expected(known)
    return sensors.share * (sensors.answer(change.u, change.reactions) + sensors.answer_within(change.surplus))


class FinerStates:
    """The error of the mesh of states under hypotheses."""

    def __init__(self, states: States) -> None:
        self.states = states
        self._finer = FinerMesh(states.device)

    def release(self) -> None:
        """Let go of the finer mesh and of all that was computed on it; a further error makes them anew."""
        self._finer = FinerMesh(self.states.device)

    def errors(self, state: SolvedState, prior: Gaussian) -> MeshErrors:
        """The error of a state, and its derivatives by the tissue; `SolveError` as `error`."""
        error, hypothesis = self.error(state.hypothesis, state), state.hypothesis
        by_tissue = []
        for axis in prior.factor.T:
            shifted = self.error(replace(hypothesis, theta=hypothesis.theta + _STEP * axis), state)
            by_tissue.append(shifted.less(error).times(1.0 / _STEP))
        return MeshErrors(error, tuple(by_tissue), self)

    def error(self, hypothesis: Hypothesis, nearby: SolvedState, tolerance: float = ROUGH) -> Difference:
        """The error of a hypothesis with a uniform stiffness within tissues, on which it hardly depends.

        `nearby`: a state near to it. `tolerance`: out-of-balance force of the finer state, relative. `SolveError` if
        there is no equilibrium on the finer mesh.
        """
        uniform = replace(hypothesis, field=np.zeros_like(hypothesis.field))
        coarse = self.states.solve(uniform, nearby.u, in_the_end=True)
        case = self.states.case_of(uniform)
        return self._finer.difference(case, uniform.theta, coarse.system, coarse.u, coarse.reactions, tolerance)
