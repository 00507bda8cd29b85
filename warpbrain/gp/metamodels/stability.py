"""Is a fitted meta-model stable? What draws are told apart by."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from warpbrain.errors import InputError
from warpbrain.gp.metamodels.fit import Fit

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law


def unstable(fit: Fit, poisson: float = 0.45, formulation: str = "coupled") -> str:
    """Why a fit cannot be computed with, by the supplement's Table 2; empty if it can.

    Parameters
    ----------
    fit : Fit
    poisson : float
        Poisson ratio at rest.
    formulation : str
        One of `warpbrain.physics.laws.FORMULATIONS`.

    Returns
    -------
    str
        The message of `warpbrain.physics.laws.stability.require_stable`, or of the law if it is none.

    Raises
    ------
    InputError
        If the Poisson ratio is outside (-1, 0.5) or the formulation is unknown.
    """
    from warpbrain.physics.laws.stability import UnstableLawError, require_stable

    try:
        law = fit.law()
    except InputError as error:
        return str(error)
    if _is_stable(law.scaled_to(1.0), poisson, formulation):
        return ""
    try:
        require_stable(law, poisson, formulation)
    except UnstableLawError as error:
        return str(error)
    return ""


@lru_cache(maxsize=64)
def _is_stable(law: Law, poisson: float, formulation: str) -> bool:
    """Whether a law of the shear modulus 1 Pa is stable; kept for the last ones that were asked for.

    The conditions are signs, and ratios to the shear modulus: they hold for a law in one unit if they do in another.
    All neo-Hookean laws are one then, so that the thousand of a prior are looked at once.
    """
    from warpbrain.physics.laws.stability import UnstableLawError, require_stable

    try:
        require_stable(law, poisson, formulation)
    except UnstableLawError:
        return False
    return True
