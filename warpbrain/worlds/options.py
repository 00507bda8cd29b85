"""Options of a diagnosis."""

from __future__ import annotations

import math
from dataclasses import dataclass

from warpbrain.errors import InputError


@dataclass(frozen=True)
class DiagnosisOptions:
    """Options of a diagnosis; `InputError` if a number makes no sense."""

    candidates: tuple[str, ...] | None = None  #: causes to look for; None: all
    alpha: float = 0.05  #: probability of a false alarm
    seed: int = 0  #: of all draws
    draws: int = 400  #: of residuals in which nothing is missing
    mesh_error: bool = True  #: of bodies: whether the error of the mesh is computed on elements of half the size
    #: Of bodies: credit mechanisms also with what nuisances could explain: an ablation, for comparisons.
    without_nuisances: bool = False
    #: Of specimens: whether glued ends are computed; otherwise states are homogeneous, as test evaluations take them.
    ends: bool = True

    def __post_init__(self) -> None:
        if not (math.isfinite(self.alpha) and 0.0 < self.alpha < 0.5):
            raise InputError(f"alpha = {self.alpha:g}: expected a number between 0 and 0.5")
        if self.draws < 1.0 / self.alpha:
            raise InputError(f"draws = {self.draws}: too few for alpha = {self.alpha:g}")
