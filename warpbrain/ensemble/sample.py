"""What goes into an ensemble and what comes out of it, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.simulation.model import Material


@dataclass(frozen=True)
class Sample:
    """One set of parameters."""

    number: int
    materials: Mapping[int, Material] | None  # by tissue label; None if none could be found
    reason: str = ""  # why there are none
    #: Of a sweep: how many standard deviations each tissue's curve is from the mean, by label
    deviations: Mapping[int, float] = field(default_factory=dict)

    @property
    def stiffness(self) -> float:
        """Largest shear modulus [Pa]: samples of like stiffness need about as many iterations, so they go together."""
        if self.materials is None:
            return 0.0
        return max(material.law.shear_modulus for material in self.materials.values())


@dataclass(frozen=True)
class Outcome:
    """How a sample ended."""

    number: int
    reason: str  # why it failed; empty if it did not
    steps: int  # time steps that were taken
    cg_iterations: int  # of all its linear solves, those of refused steps too
    time: float  # of the last state [s]
    residual: float  # out-of-balance force of that state relative to all nodal forces, with every load at its end
    min_J: float  # smallest volume ratio of an element in that state
    u: Floats  # (n, 3), displacement [m]; of no nodes if the sample failed
    held: NDArray[np.intp]  # nodes with constrained components, and what holds these [N], (held, 3)
    support: Floats

    @property
    def failed(self) -> bool:
        return bool(self.reason)

    @property
    def reactions(self) -> Floats:
        """What holds the constrained components of all nodes [N], shape (n, 3)."""
        reactions = np.zeros_like(self.u)
        reactions[self.held] = self.support
        return reactions

    def without_fields(self) -> Outcome:
        """The same without what is of nodes."""
        return replace(self, u=_NOTHING, held=_NOWHERE, support=_NOTHING)


_NOTHING, _NOWHERE = np.zeros((0, 3)), np.zeros(0, dtype=np.intp)


def failure(number: int, reason: str, steps: int = 0, cg_iterations: int = 0, time: float = 0.0) -> Outcome:
    """The outcome of a sample that has none."""
    nan = float("nan")
    return Outcome(number, reason, steps, cg_iterations, time, nan, nan, _NOTHING, _NOWHERE, _NOTHING)
