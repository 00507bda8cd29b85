"""States of a case under hypotheses: other tissue, a stiffness field, one or several mechanisms more."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case
from warpbrain.diagnosis.sensors import Sensors, sensors_at
from warpbrain.diagnosis.stiffness_field import StiffnessField, stiffness_modes
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.parameters import Parameters
from warpbrain.physics.mechanism import Mechanism
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]

#: Out-of-balance force of an equilibrium, relative.
TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """What is taken to be so.

    Attributes
    ----------
    theta : (p,) array
        Of the tissues; see `Parameters`.
    field : (k,) array
        Of the modes of the stiffness field, in standard deviations.
    mechanisms : tuple of Mechanism
        Beside those of the case.
    releases : tuple of str
        Node sets that the case's boundaries no longer hold.
    """

    theta: Floats
    field: Floats
    mechanisms: tuple[Mechanism, ...] = ()
    releases: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SolvedState:
    """An equilibrium under a hypothesis.

    Attributes
    ----------
    hypothesis : Hypothesis
    system : System
    u, reactions : (N, 3) array
    sensors : Sensors
        There.
    """

    hypothesis: Hypothesis
    system: System
    u: Floats
    reactions: Floats
    sensors: Sensors


class States:
    """Solves a case under hypotheses.

    Parameters
    ----------
    case : Case
    device : str, optional

    Attributes
    ----------
    solves : int
    """

    def __init__(self, case: Case, device: str | None = None) -> None:
        self.case = case
        self.device = device
        self.parameters = Parameters.of(case)
        self.observations = Observations.to_fit(case)
        self.centre = self.observations.centre
        self.modes = stiffness_modes(case.remaining[0])
        self.solves = 0

    def case_of(self, hypothesis: Hypothesis) -> Case:
        """The case that a user would write for a hypothesis, but for the stiffness field."""
        applied = self.parameters.applied(self.case, hypothesis.theta)
        boundaries = tuple(
            b for b in applied.boundaries if not (isinstance(b, Fixed) and b.nodes in hypothesis.releases)
        )
        kept = tuple(
            m for m in applied.mechanisms if all(new.several or new.kind != m.kind for new in hypothesis.mechanisms)
        )
        return replace(applied, boundaries=boundaries, mechanisms=(*kept, *hypothesis.mechanisms))

    def solve(self, hypothesis: Hypothesis, start: Floats | None = None) -> SolvedState:
        """The equilibrium under a hypothesis, from a displacement (N, 3) [m] that is near to it.

        Raises
        ------
        InputError
            If a law is not stable.
        SolveError
            If there is none.
        """
        self.solves += 1
        model, _ = model_of(self.case_of(hypothesis))
        if hypothesis.field.any():
            field = StiffnessField(log_factor=self.modes @ hypothesis.field)
            model = replace(model, mechanisms=(*model.mechanisms, field))
        system = System(model, self.device)
        external = model.external_forces()
        found = EquilibriumSolver(system, EquilibriumOptions(tolerance=TOLERANCE)).solve(external, start)
        reactions = np.where(model.constrained, found.internal - external, 0.0)
        sensors = sensors_at(self.observations, found.u, reactions, self.centre)
        return SolvedState(hypothesis, system, found.u, reactions, sensors)
