"""Prior of a case's tissues: that of the generative model, or about the laws that the case declares."""

from __future__ import annotations

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.parameters import Gaussian, Parameters
from warpbrain.estimation.prior import declared, declared_deviations, prior_modes, prior_of


def tissue_prior(case: Case, parameters: Parameters) -> Gaussian:
    """A normal distribution of `theta`.

    Tissues with groups of the generative model have its prior, of Ogden's exponents the part with the signs of the
    case's own laws; the others are around what the case says.
    """
    try:
        modes = prior_modes(prior_of(case), parameters) if any(parameters.groups) else ()
    except (InputError, SolveError):
        modes = ()
    if not modes:
        return Gaussian(declared(case, parameters), np.diag(declared_deviations(case, parameters) ** 2))
    try:
        theta = declared(case, parameters)
    except InputError:
        return modes[0].gaussian
    matching = [mode for mode in modes if np.all((theta >= mode.low) & (theta <= mode.high))]
    return (matching or list(modes))[0].gaussian
