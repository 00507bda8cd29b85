"""Options of a diagnosis."""

import math
from dataclasses import dataclass

from warpbrain.errors import InputError, require_kind


@dataclass(frozen=True)
class DiagnosisOptions:
    """Options of a diagnosis.

    Parameters
    ----------
    candidates : tuple of str or None
        Causes to look for; None: all.
    alpha : float
        Probability of a false alarm.
    seed : int
        Of all draws.
    draws : int
        Of residuals in which nothing is missing.
    mesh_error : bool
        Of bodies: whether the error of the mesh is computed on elements of half the size.
    without_nuisances : bool
        Of bodies: credit mechanisms also with what nuisances could explain: an ablation, for comparisons.
    ends : bool
        Of specimens: whether glued ends are computed; otherwise states are taken for homogeneous, as test evaluations
        do.

    Raises
    ------
    InputError
        If a number makes no sense.
    """

    candidates: tuple[str, ...] | None = None
    alpha: float = 0.05
    seed: int = 0
    draws: int = 400
    mesh_error: bool = True
    without_nuisances: bool = False
    ends: bool = True

    def __post_init__(self) -> None:
        require_kind(self.candidates, (tuple, list, type(None)), "candidates", "a sequence of names")
        if not (math.isfinite(self.alpha) and 0.0 < self.alpha < 0.5):
            raise InputError(f"alpha = {self.alpha:g}: expected a number between 0 and 0.5")
        if self.draws < 1.0 / self.alpha:
            raise InputError(f"draws = {self.draws}: too few for alpha = {self.alpha:g}")
