"""The prior of a case's tissues, as one normal distribution or as several that the data choose between.

Ogden's stable exponents lie above 1 and below -2 with none between them, so a prior of Ogden laws falls apart into one
cluster for each combination of signs. Within a cluster a normal distribution is a fair description; over all of them it
is none. Each is a mode: the estimate is sought in every one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.cases.drawn import require_groups
from warpbrain.errors import InputError
from warpbrain.estimation.declared_prior import declared_prior
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.estimation.parameters import Parameters
from warpbrain.gp.prior import Prior
from warpbrain.gp.process import Process

#: Draws on which the prior rests.
DRAWS = 500
#: Part of the draws that makes a cluster of signs a mode of its own.
_LEAST_SHARE = 0.02
#: Smallest standard deviation of a coordinate that has two ends, relative to its range.
_NARROWEST = 0.05


@dataclass(frozen=True, eq=False)
class PriorMode:
    """A part of the prior that is nearly normal.

    Attributes
    ----------
    share : float
        Of the prior.
    gaussian : Gaussian
    low, high : (p,) array
        Where it ends.
    """

    share: float
    gaussian: Gaussian
    low: Floats
    high: Floats


def prior_of(case: Case, model: Process | None = None, count: int = DRAWS, seed: int = 0) -> Prior:
    """What the generative model says of a case's tissues; about what the case declares where none is of a group of it.

    Parameters
    ----------
    case : Case
    model : Process, optional
        The one that is the default unless given.
    count, seed : int
        Draws on which it rests.

    Raises
    ------
    InputError
        With file, tissue and key, if a tissue has no group, or one that the model has seen no study of.
    SolveError
        If no stable law is found.
    """
    parameters = Parameters.of(case)
    if not any(parameters.groups) and all(case.tissues[labels[0]].law is not None for labels in parameters.labels):
        return declared_prior(case, count, seed)
    from warpbrain.gp.trained import trained

    asked = trained() if model is None else model
    require_groups(case, [label for labels in parameters.labels for label in labels], asked)
    return Prior.of(
        asked, parameters.groups, parameters.laws_of, parameters.poisson, parameters.formulations, count, seed
    )


def prior_modes(prior: Prior, parameters: Parameters) -> tuple[PriorMode, ...]:
    """Modes of a prior, the most probable first; what lies in rarer clusters counts with the others.

    Raises
    ------
    InputError
        If the prior is not of these parameters.
    """
    if prior.theta.shape[1] != len(parameters):
        names = ", ".join(parameters.names)
        raise InputError(f"prior: of {prior.theta.shape[1]} parameters; the case has {len(parameters)}: {names}")
    signed = np.array([parameter.coordinate.signed for parameter in parameters])
    signs = np.sign(prior.theta[:, signed])
    kinds, cluster, counts = np.unique(signs, axis=0, return_inverse=True, return_counts=True)
    kept = np.flatnonzero(counts >= max(_LEAST_SHARE * len(signs), 5 * len(parameters)))
    if len(kept) == 0:
        raise InputError(f"prior: {len(signs)} draws are too few for {len(parameters)} parameters")
    total = counts[kept].sum()
    modes = []
    for number in kept[np.argsort(-counts[kept])]:
        low, high = parameters.low, parameters.high
        members = prior.theta[cluster.ravel() == number]
        # no draw lies nearer to zero: there laws are not stable
        low[signed] = np.where(kinds[number] > 0.0, members[:, signed].min(axis=0), low[signed])
        high[signed] = np.where(kinds[number] < 0.0, members[:, signed].max(axis=0), high[signed])
        covariance = np.atleast_2d(np.cov(members, rowvar=False))
        # draws that all lie on one end have no spread, but a prior that excludes everything else is no prior
        ranges = parameters.high - parameters.low
        least = np.where(np.isfinite(ranges), (_NARROWEST * np.where(np.isfinite(ranges), ranges, 0.0)) ** 2, 0.0)
        covariance += np.diag(np.maximum(least - np.diag(covariance), 0.0))
        gaussian = Gaussian(members.mean(axis=0), covariance)
        modes.append(PriorMode(float(counts[number] / total), gaussian, low, high))
    return tuple(modes)
