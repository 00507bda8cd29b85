"""Prior of a case's tissues: that of the generative model, or about the laws that the case declares."""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.prior_modes import prior_modes, prior_of
from warpbrain.inference.beliefs import belief

#: Beliefs of their standard deviations where no study is named, by what a coordinate is of.
_DEVIATIONS = {
    "ln(mu0 / Pa)": "tissue.declared_modulus",
    "C2 / (C1 + C2)": "tissue.declared_share",
    "alpha": "tissue.declared_exponent",
}


def tissue_prior(case: Case, parameters: Parameters) -> Gaussian:
    """A normal distribution of `theta`.

    Tissues with groups of the generative model have its prior, of Ogden's exponents the part with the signs of the
    case's own laws; the others are around what the case says.
    """
    try:
        modes = prior_modes(prior_of(case), parameters)
    except (InputError, SolveError):
        mean = declared(case, parameters)
        sd = np.array([belief(_DEVIATIONS[parameter.coordinate.name]) for parameter in parameters])
        return Gaussian(mean, np.diag(sd**2))
    try:
        theta = declared(case, parameters)
    except InputError:
        return modes[0].gaussian
    matching = [mode for mode in modes if np.all((theta >= mode.low) & (theta <= mode.high))]
    return (matching or list(modes))[0].gaussian


def declared(case: Case, parameters: Parameters) -> Floats:
    """`theta` (p,) of the laws that the case declares; `InputError` if it leaves one to the prior."""
    return parameters.theta_of([case.tissues[labels[0]].known_law for labels in parameters.labels])
