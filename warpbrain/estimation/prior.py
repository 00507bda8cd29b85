"""The prior of a case's tissues, as one normal distribution or as several that the data choose between.

Ogden's stable exponents lie above 1 and below -2 with none between them, so a prior of Ogden laws falls apart into one
cluster for each combination of signs. Within a cluster a normal distribution is a fair description; over all of them it
is none. Each is a mode: the estimate is sought in every one.

Tissue that is of no group of the generative model has a prior around the laws that the case declares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.cases.drawn import require_groups
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.parameters import Gaussian, Parameters
from warpbrain.gp.literature.study import Study
from warpbrain.gp.prior import Prior, coordinates
from warpbrain.gp.process import Process
from warpbrain.inference.beliefs import belief
from warpbrain.physics.laws.law import MODULUS

#: Draws on which the prior rests.
DRAWS = 500
#: Part of the draws that makes a cluster of signs a mode of its own.
_LEAST_SHARE = 0.02
#: Smallest standard deviation of a coordinate that has two ends, relative to its range.
_NARROWEST = 0.05


def declared(case: Case, parameters: Parameters) -> Floats:
    """`theta` (p,) of the laws that the case declares; `InputError` if it leaves one to the prior."""
    return parameters.theta_of([case.tissues[labels[0]].known_law for labels in parameters.labels])


def declared_deviations(case: Case, parameters: Parameters) -> Floats:
    """Standard deviation (p,) of each parameter about what a case declares."""
    deviations = []
    for labels, law in zip(parameters.labels, parameters.laws_of, strict=True):
        accuracy = case.tissues[labels[0]].accuracy
        for coordinate in coordinates(law):
            # of a relative error that is small the logarithm's
            known = accuracy if coordinate == MODULUS else None
            deviations.append(belief(coordinate.belief) if known is None else known)
    return np.array(deviations)


@dataclass(frozen=True)
class _NoStudies:
    """What stands for the generative model where it has seen no study of any tissue; see `warpbrain.gp.process`."""

    name: str = "declared"
    variant: str = "about the case's own laws"
    studies: tuple[Study, ...] = ()
    groups: tuple[str, ...] = ()

    def curve(self, group: str, stretches: ArrayLike, k: ArrayLike = 0.0) -> Floats:
        """There is none."""
        raise InputError(f"'{group}': the prior is about the laws that the case declares, and has no curves")

    def draw(self, groups: Sequence[str], stretches: ArrayLike, number: int | tuple[int, ...], seed: int = 0) -> Floats:
        """There is none."""
        raise InputError("the prior is about the laws that the case declares, and has no curves")


def _declared_prior(case: Case, parameters: Parameters, count: int, seed: int) -> Prior:
    """A normal distribution about the laws that a case declares, within the ends of their parameters."""
    rng, mean = np.random.default_rng([seed, 2]), declared(case, parameters)
    deviations = declared_deviations(case, parameters)
    draws: list[Floats] = []
    attempts = 0
    while len(draws) < count:
        attempts += 1
        theta = mean + deviations * rng.normal(size=len(mean))
        if np.all((theta > parameters.low) & (theta < parameters.high)):
            draws.append(theta)
    bounds = np.zeros(len(parameters.tissues))
    laws, poisson, formulations = parameters.laws_of, parameters.poisson, parameters.formulations
    return Prior(_NoStudies(), parameters.tissues, laws, poisson, formulations, seed, np.array(draws), attempts, bounds)


def prior_of(case: Case, model: Process | None = None, count: int = DRAWS, seed: int = 0) -> Prior:
    """What the generative model says of a case's tissues; about what the case declares where none is of a group of it.

    It rests on so many draws. `InputError` if a tissue has no group, or one that the model has seen no study of;
    `SolveError` if no stable law is found.
    """
    parameters = Parameters.of(case)
    if not any(parameters.groups) and all(case.tissues[labels[0]].law is not None for labels in parameters.labels):
        return _declared_prior(case, parameters, count, seed)
    from warpbrain.gp.trained import trained

    process = trained() if model is None else model
    require_groups(case, [label for labels in parameters.labels for label in labels], process)
    return Prior.of(
        process, parameters.groups, parameters.laws_of, parameters.poisson, parameters.formulations, count, seed
    )


@dataclass(frozen=True, eq=False)
class PriorMode:
    """A nearly normal part of the prior: its share, and where it ends, `low` and `high` (p,)."""

    share: float
    gaussian: Gaussian
    low: Floats
    high: Floats


def prior_modes(prior: Prior, parameters: Parameters) -> tuple[PriorMode, ...]:
    """Modes of a prior, the most probable first; what lies in rarer clusters counts with the others.

    `InputError` if the prior is not of these parameters.
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
    # draws that all lie on one end have no spread, but a prior that excludes everything else is no prior
    ranges = parameters.high - parameters.low
    least = np.where(np.isfinite(ranges), (_NARROWEST * np.where(np.isfinite(ranges), ranges, 0.0)) ** 2, 0.0)
    modes = []
    for number in kept[np.argsort(-counts[kept])]:
        low, high = parameters.low, parameters.high
        members = prior.theta[cluster.ravel() == number]
        # no draw lies nearer to zero: there laws are not stable
        low[signed] = np.where(kinds[number] > 0.0, members[:, signed].min(axis=0), low[signed])
        high[signed] = np.where(kinds[number] < 0.0, members[:, signed].max(axis=0), high[signed])
        covariance = np.atleast_2d(np.cov(members, rowvar=False))
        covariance += np.diag(np.maximum(least - np.diag(covariance), 0.0))
        modes.append(PriorMode(float(counts[number] / total), Gaussian(members.mean(axis=0), covariance), low, high))
    return tuple(modes)


def tissue_prior(case: Case, parameters: Parameters) -> Gaussian:
    """The prior of a diagnosis: one normal distribution of `theta`.

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
