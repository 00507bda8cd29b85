"""What candidates explain of residuals at one state, to first order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.evidence import Explanation
from warpbrain.diagnosis.screening import Screen, Screening
from warpbrain.mesh import TetMesh
from warpbrain.worlds.body.dictionary import Candidates
from warpbrain.worlds.body.effects import Effect

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Screened:
    """What was compared at a state, and what came of it.

    Attributes
    ----------
    base : Base
    candidates : Candidates
        At the state.
    screening : Screening
        With noise and nuisances there.
    residual : (n,) array
        Of the linear model, with all nuisances in the middle of their prior.
    screen : Screen
    kappa : float
        Factor on the noise.
    """

    base: Base
    candidates: Candidates
    screening: Screening
    residual: Floats
    screen: Screen
    kappa: float

    @property
    def explanation(self) -> Explanation:
        """Noise and nuisances."""
        return self.screening.explanation

    @property
    def mesh(self) -> TetMesh:
        """Of the body."""
        return self.base.at.system.model.mesh

    def best_effect(self, kind: str) -> Effect:
        """The most probable effect of a kind."""
        return self.candidates.effects[self.screen.best_effect(self.candidates, kind)]
