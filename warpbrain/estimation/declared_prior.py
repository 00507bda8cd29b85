"""The prior of tissue that is of no group of the generative model: around the laws that a case declares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.estimation.parameters import Parameters
from warpbrain.gp.coordinates import coordinates
from warpbrain.gp.literature.study import Study
from warpbrain.gp.prior import Prior
from warpbrain.inference.beliefs import belief

#: Beliefs of standard deviations where no study is named, by what a coordinate is of.
_DEVIATIONS = {
    "ln(mu0 / Pa)": "tissue.declared_modulus",
    "C2 / (C1 + C2)": "tissue.declared_share",
    "alpha": "tissue.declared_exponent",
}


def declared(case: Case, parameters: Parameters) -> Floats:
    """`theta` (p,) of the laws that the case declares; `InputError` if it leaves one to the prior."""
    return parameters.theta_of([case.tissues[labels[0]].known_law for labels in parameters.labels])


def declared_deviations(case: Case, parameters: Parameters) -> Floats:
    """Standard deviation (p,) of each parameter about what a case declares."""
    found = []
    for labels, law in zip(parameters.labels, parameters.laws_of, strict=True):
        accuracy = case.tissues[labels[0]].accuracy
        for coordinate in coordinates(law):
            believed = belief(_DEVIATIONS[coordinate.name])
            # of a relative error that is small the logarithm's
            found.append(accuracy if accuracy is not None and coordinate.name == "ln(mu0 / Pa)" else believed)
    return np.array(found)


@dataclass(frozen=True)
class _NoStudies:
    """What stands for the generative model where it has seen no study of any tissue."""

    name: str = "declared"
    variant: str = "about the case's own laws"
    studies: tuple[Study, ...] = ()
    groups: tuple[str, ...] = ()

    def curve(self, group: str, stretches: ArrayLike, k: ArrayLike = 0.0) -> Floats:
        """See `warpbrain.gp.process.Process`."""
        raise InputError(f"'{group}': the prior is about the laws that the case declares, and has no curves")

    def draw(self, groups: Sequence[str], stretches: ArrayLike, number: int | tuple[int, ...], seed: int = 0) -> Floats:
        """See `warpbrain.gp.process.Process`."""
        raise InputError("the prior is about the laws that the case declares, and has no curves")


def declared_prior(case: Case, count: int, seed: int) -> Prior:
    """A normal distribution about the laws that a case declares, within the ends of their parameters.

    Parameters
    ----------
    case : Case
    count, seed : int
        Draws on which density and Gaussian approximation rest.

    Raises
    ------
    InputError
        If the case leaves a law to the prior.
    """
    parameters = Parameters.of(case)
    rng, mean = np.random.default_rng([seed, 2]), declared(case, parameters)
    deviations = declared_deviations(case, parameters)
    found: list[Floats] = []
    attempts = 0
    while len(found) < count:
        attempts += 1
        theta = mean + deviations * rng.normal(size=len(mean))
        if np.all((theta > parameters.low) & (theta < parameters.high)):
            found.append(theta)
    bounds = np.zeros(len(parameters.tissues))
    laws, poisson, formulations = parameters.laws_of, parameters.poisson, parameters.formulations
    return Prior(_NoStudies(), parameters.tissues, laws, poisson, formulations, seed, np.array(found), attempts, bounds)
