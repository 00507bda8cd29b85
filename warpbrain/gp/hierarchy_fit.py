"""Fitting a hierarchy: the one of largest posterior density, and a sample of the others that the data allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import SolveError
from warpbrain.gp.hierarchy import CENTRE, EFFECTS, MEAN_ASYMMETRY, REST, Hierarchy, Observations, Structure, prior

#: Hierarchies of a sample, unless said otherwise.
SAMPLE = 24
#: Standard deviation of an effect that is left out.
_NONE = 1e-6
#: Step in a logarithm by which curvatures are differenced from gradients.
_STEP = 1e-4


@dataclass(frozen=True)
class Fitted:
    """How the fit of a hierarchy ended: the objective is the negative log of likelihood times prior.

    The condition number of the covariance of the observations is in the 2-norm.
    """

    objective: float
    converged: bool
    message: str
    iterations: int
    condition: float


def fit_hierarchy(
    seen: Observations,
    kernel: str = "matern52",
    first: Hierarchy | None = None,
    without: Sequence[str] = (),
    mean_asymmetry: tuple[float, float] = MEAN_ASYMMETRY,
) -> tuple[Hierarchy, Fitted]:
    """The hierarchy of largest posterior density.

    Parameters
    ----------
    seen : Observations
    kernel : str
        Of the curves.
    first : Hierarchy, optional
        Where to start from; the median of the prior unless given.
    without : sequence of str
        Effects that are left out: their standard deviation is 1e-6, for comparisons.
    mean_asymmetry : tuple of two floats
        See `Hierarchy`.

    Raises
    ------
    SolveError
        If the covariance cannot be factored at the start.
    """
    from scipy.optimize import minimize

    mean, spread = prior()
    structure = Structure.of(seen.places, seen.places)
    start = mean if first is None else first.to_vector()
    fixed = np.array([name in without for name in EFFECTS] + [False])
    start = np.where(fixed, np.log(_NONE), start)

    def objective(vector: Floats) -> tuple[float, Floats]:
        hierarchy = Hierarchy.from_vector(vector, kernel, mean_asymmetry)
        value, gradient = negative_log_likelihood(hierarchy, seen, structure)
        away = np.where(fixed, 0.0, (vector - mean) / spread)
        gradient = np.where(fixed, 0.0, gradient)
        return value + 0.5 * float(away @ away), gradient + away / spread

    found = minimize(objective, start, jac=True, method="L-BFGS-B", options={"maxiter": 200, "ftol": 1e-9})
    if not np.isfinite(found.fun):
        raise SolveError("the covariance of the studies is not positive definite in double precision")
    hierarchy = Hierarchy.from_vector(found.x, kernel, mean_asymmetry)
    condition = float(np.linalg.cond(hierarchy.covariance_of(structure) + REST**2 * np.eye(len(seen.log_modulus))))
    return hierarchy, Fitted(float(found.fun), bool(found.success), str(found.message), int(found.nit), condition)


def sample_hierarchies(best: Hierarchy, seen: Observations, count: int, seed: int = 0) -> tuple[Hierarchy, ...]:
    """Hierarchies that the data allow, drawn by Laplace's approximation of the posterior of their logarithms.

    Thirty papers do not say how far papers differ to more than some tens of per cent, and of some effects hardly
    anything: predictions by the best hierarchy alone are too sure. Priors are log-normal, so where data say little the
    posterior is normal in the logarithms already. Draws come in pairs on opposite sides of the best.

    Parameters
    ----------
    best : Hierarchy
        Of largest posterior density. Effects that it lacks stay out.
    seen : Observations
    count, seed : int
    """
    centre = best.to_vector()
    _, spread = prior()
    free = centre > np.log(2.0 * _NONE)
    curvature = np.diag(spread**-2.0)
    structure = Structure.of(seen.places, seen.places)
    _, here = negative_log_likelihood(best, seen, structure)
    for k in np.flatnonzero(free):
        ahead = Hierarchy.from_vector(centre + _STEP * np.eye(len(centre))[k], best.kernel, best.mean_asymmetry)
        curvature[:, k] += (negative_log_likelihood(ahead, seen, structure)[1] - here) / _STEP
    values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T)[np.ix_(free, free)])
    # the posterior is no wider than the prior along any direction
    root = vectors / np.sqrt(np.maximum(values, 1.0 / spread.max() ** 2))
    normal = np.random.default_rng(seed).standard_normal(((count + 1) // 2, len(values)))
    found = np.tile(centre, (count, 1))
    found[:, free] += np.concatenate([normal, -normal])[:count] @ root.T
    return tuple(Hierarchy.from_vector(vector, best.kernel, best.mean_asymmetry) for vector in found)


def negative_log_likelihood(hierarchy: Hierarchy, seen: Observations, structure: Structure) -> tuple[float, Floats]:
    """Of observations, with its derivative by `Hierarchy.to_vector`; infinite if the covariance cannot be factored.

    Parameters
    ----------
    hierarchy : Hierarchy
    seen : Observations
    structure : Structure
        Of its places with themselves, which many hierarchies share.
    """
    from scipy.linalg import cho_solve, cholesky

    identity = np.eye(len(seen.log_modulus))
    away = seen.log_modulus - CENTRE
    try:
        L = cholesky(hierarchy.covariance_of(structure) + REST**2 * identity, lower=True)
    except np.linalg.LinAlgError:
        return np.inf, np.zeros(len(EFFECTS) + 1)
    weights = cho_solve((L, True), away)
    G = 0.5 * (cho_solve((L, True), identity) - np.outer(weights, weights))
    value = 0.5 * float(away @ weights) + float(np.log(np.diag(L)).sum()) + 0.5 * len(away) * np.log(2.0 * np.pi)
    return value, hierarchy.slopes(structure, G)
