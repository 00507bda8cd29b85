"""One linearised Gaussian model of everything that was recorded, and the posterior over sets of causes.

A world (a body, a specimen) gives the residuals `r` of its recorded rows at a state, the covariance of their noise, the
columns of what is always uncertain (nuisances), and `Cause`s, each with the columns of its possible places. From these

    GaussianModel       marginal, conditional and posterior distributions of rows and coefficients
    Posterior           evidence of no cause, of every cause, every pair, and of triples
    Decision            the verdict of least expected loss

Nothing here knows Warp, a mesh or the name of a mechanism.
"""

from warpbrain.inference.gaussian import GaussianModel

__all__ = ["GaussianModel"]
