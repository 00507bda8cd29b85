"""Is a fitted meta-model stable? What draws are told apart by."""

from __future__ import annotations

from warpbrain.errors import InputError
from warpbrain.gp.metamodels.fit import Fit


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
    try:
        require_stable(law, poisson, formulation)
    except UnstableLawError as error:
        return str(error)
    return ""
