"""One linearised Gaussian model of everything that was recorded, and the posterior over sets of causes.

A world (a body, a specimen) gives the residuals `r` of its recorded rows at a state, the covariance of their noise, the
columns of what is always uncertain (nuisances), and `Cause`s, each with the columns of its possible places. From these

    GaussianModel       marginal, conditional and posterior distributions of rows and coefficients
    with_gross_errors   the density of rows where some points may be mispaired, for each hypothesis by itself
    posterior           evidence of no cause, of every cause, every pair, and of triples

Nothing here knows Warp, a mesh or the name of a mechanism.
"""

from warpbrain.inference.causes import Cause, Kind, Place
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.gross_errors import GrossErrors, with_gross_errors
from warpbrain.inference.noise import Outliers
from warpbrain.inference.subsets import Search, posterior

__all__ = [
    "Cause",
    "GaussianModel",
    "GrossErrors",
    "Kind",
    "Outliers",
    "Place",
    "Search",
    "posterior",
    "with_gross_errors",
]
