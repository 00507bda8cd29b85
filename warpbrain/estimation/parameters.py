"""The vector `theta` of a case: the coordinates of the laws of its tissues, one tissue after the other; and a normal
distribution of it: what is believed before anything was observed, or known after it.

Ogden's stable exponents lie above 1 and below -2 with none between them, so a prior of Ogden laws falls apart into one
cluster for each combination of signs. Within a cluster a normal distribution is a fair description; over all of them it
is none. Each is a mode: the estimate is sought in every one. Tissue that is of no group of the generative model has a
prior around the laws that the case declares.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from types import SimpleNamespace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Bools, Floats
from warpbrain.cases.case import Case
from warpbrain.cases.drawn import require_groups
from warpbrain.errors import InputError, SolveError
from warpbrain.gp.prior import Prior, coordinates, laws_from, to_coordinates
from warpbrain.gp.process import Process
from warpbrain.inference.beliefs import belief
from warpbrain.physics.laws import Law, NeoHookean
from warpbrain.physics.laws.law import MODULUS, Coordinate
from warpbrain.physics.laws.stability import require_stable
from warpbrain.physics.mechanism import Substituting
from warpbrain.physics.words import enumerated
from warpbrain.simulation.model import Material


@dataclass(frozen=True)
class Parameter:
    """One number of `theta`: a coordinate of a tissue's law (`warpbrain.physics.laws.law`)."""

    tissue: str
    coordinate: Coordinate

    @property
    def name(self) -> str:
        """With tissue and unit."""
        return f"{self.tissue}: {self.coordinate.name}"

    @property
    def is_modulus(self) -> bool:
        """The logarithm of a shear modulus."""
        return self.coordinate == MODULUS


@dataclass(frozen=True)
class Parameters:
    """What `theta` means in a case.

    Tissues that name one group of the generative model are one tissue: they share their parameters.
    """

    labels: tuple[tuple[int, ...], ...]  # of each tissue in the simulated mesh, increasing
    tissues: tuple[str, ...]  # names
    groups: tuple[str, ...]  # of the generative model; may be empty
    laws_of: tuple[str, ...]
    formulations: tuple[str, ...]
    poisson: float  # ratio at rest, which is kept: that of the case, or what a mechanism says that it is

    @classmethod
    def of(cls, case: Case) -> Parameters:
        """The parameters of a case's tissues; those that were resected whole have none.

        `InputError` if tissues of one group have different laws or formulations, or a mechanism says what law it is.
        """
        members: dict[str, list[int]] = {}
        for label in case.remaining[0].labels:
            # a tissue without a group is one of its own
            members.setdefault(case.tissues[label].prior or f"tissue {label}", []).append(label)
        first = [case.tissues[labels[0]] for labels in members.values()]
        for labels, tissue in zip(members.values(), first, strict=True):
            for label in labels:
                other = case.tissues[label]
                if (other.model, other.formulation) != (tissue.model, tissue.formulation):
                    raise InputError(
                        f"{case.path}: [tissue.{label}] prior: {other.name} and {tissue.name} are one tissue to the "
                        f"generative model, '{tissue.prior}', but {other.name} is {other.model} ({other.formulation}) "
                        f"and {tissue.name} {tissue.model} ({tissue.formulation})"
                    )
        return cls(
            tuple(tuple(labels) for labels in members.values()),
            tuple(enumerated([case.tissues[label].name for label in labels]) for labels in members.values()),
            tuple(tissue.prior for tissue in first),
            tuple(tissue.model for tissue in first),
            tuple(tissue.formulation for tissue in first),
            _poisson(case),
        )

    def __iter__(self) -> Iterator[Parameter]:
        """Every number of `theta`, in order."""
        for tissue, law in zip(self.tissues, self.laws_of, strict=True):
            for coordinate in coordinates(law):
                yield Parameter(tissue, coordinate)

    def __len__(self) -> int:
        return sum(len(coordinates(law)) for law in self.laws_of)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self)

    @property
    def low(self) -> Floats:
        """Where each ends, shape (p,)."""
        return np.array([parameter.coordinate.low for parameter in self])

    @property
    def high(self) -> Floats:
        """Where each ends, shape (p,)."""
        return np.array([parameter.coordinate.high for parameter in self])

    @property
    def reach(self) -> Floats:
        """How far one step of an estimation may go, shape (p,)."""
        return np.array([parameter.coordinate.reach for parameter in self])

    @property
    def is_modulus(self) -> Bools:
        """Which are logarithms of shear moduli, shape (p,)."""
        return np.array([parameter.is_modulus for parameter in self])

    def theta_of(self, laws: Sequence[Law]) -> Floats:
        """The vector (p,) of the law of each tissue; `InputError` if it is not as in the case, or of several terms."""
        theta: list[float] = []
        for law, tissue, name in zip(laws, self.tissues, self.laws_of, strict=True):
            if law.name != name:
                raise InputError(f"{tissue}: found the law {law.name}, expected {name}")
            theta.extend(to_coordinates(law))
        return np.array(theta)

    def laws(self, theta: ArrayLike) -> tuple[Law, ...]:
        """The law of each tissue; `InputError` if `theta` is not as long as there are parameters, or not finite."""
        point = np.asarray(theta, dtype=np.float64)
        if point.shape != (len(self),) or not np.isfinite(point).all():
            raise InputError(f"theta = {point.tolist()}: expected {len(self)} numbers: {', '.join(self.names)}")
        return laws_from(self.laws_of, point.tolist())

    def materials(self, theta: ArrayLike) -> dict[int, Material]:
        """Materials by tissue label; `InputError` as from `laws`."""
        each = zip(self.labels, self.laws(theta), self.formulations, strict=True)
        return {label: Material(law, self.poisson, shape) for labels, law, shape in each for label in labels}

    def applied(self, case: Case, theta: ArrayLike) -> Case:
        """The case with the laws of `theta`; `InputError` as from `laws`."""
        tissues = dict(case.tissues)
        for labels, law in zip(self.labels, self.laws(theta), strict=True):
            for label in labels:
                tissues[label] = replace(tissues[label], law=law)
        return replace(case, tissues=tissues)

    def require_possible(self, theta: ArrayLike) -> None:
        """Raise `InputError` if a tissue's law is not stable; see `warpbrain.physics.laws.stability`."""
        for tissue, law, formulation in zip(self.tissues, self.laws(theta), self.formulations, strict=True):
            try:
                require_stable(law, self.poisson, formulation)
            except InputError as error:
                raise InputError(f"{tissue}: {error}") from None


def _poisson(case: Case) -> float:
    """Poisson ratio with what mechanisms say of it; `InputError` if one says another law."""
    law, poisson = NeoHookean(1.0), case.poisson
    for mechanism in case.mechanisms:
        if isinstance(mechanism, Substituting):
            another, poisson, _ = mechanism.substitute(0, law, poisson, "coupled")
            if another is not law:
                raise InputError(
                    f"{case.path}: [[mechanism]] kind = '{mechanism.kind}': says what law tissues have, and so does an "
                    "estimate: leave it out, or write its law into the tissues"
                )
    return poisson


@dataclass(frozen=True, eq=False)
class Gaussian:
    """A normal distribution of `theta`: mean (p,) and covariance (p, p), positive definite or `InputError`."""

    mean: Floats
    covariance: Floats

    def __post_init__(self) -> None:
        try:
            _ = self.factor
        except np.linalg.LinAlgError:
            raise InputError("the covariance of the parameters is not positive definite") from None

    @cached_property
    def factor(self) -> Floats:
        """Cholesky factor `L` of the covariance, which takes independent unit normals to `theta - mean`."""
        return np.asarray(np.linalg.cholesky(self.covariance), dtype=np.float64)

    @cached_property
    def precision(self) -> Floats:
        inverse = np.linalg.inv(self.factor)
        return inverse.T @ inverse

    @property
    def standard_deviations(self) -> Floats:
        """Of each parameter, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def negative_log(self, theta: Floats) -> float:
        """Negative log density, less its constant."""
        away = theta - self.mean
        return 0.5 * float(away @ (self.precision @ away))


#: Draws on which the prior rests.
_DRAWS = 500
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


#: What stands for the generative model where it has seen no study of any tissue: there are no curves.
_NO_STUDIES = SimpleNamespace(name="declared", variant="about the case's own laws", studies=(), groups=())


def _declared_prior(case: Case, parameters: Parameters, seed: int) -> Prior:
    """A normal distribution about the laws that a case declares, within the ends of their parameters."""
    rng, mean = np.random.default_rng([seed, 2]), declared(case, parameters)
    deviations = declared_deviations(case, parameters)
    draws: list[Floats] = []
    attempts = 0
    while len(draws) < _DRAWS:
        attempts += 1
        theta = mean + deviations * rng.normal(size=len(mean))
        if np.all((theta > parameters.low) & (theta < parameters.high)):
            draws.append(theta)
    about = parameters.tissues, parameters.laws_of, parameters.poisson, parameters.formulations, seed
    return Prior(cast(Process, _NO_STUDIES), *about, np.array(draws), attempts, np.zeros(len(parameters.tissues)))


def prior_of(case: Case, model: Process | None = None, seed: int = 0) -> Prior:
    """What the generative model says of a case's tissues; about what the case declares where none is of a group of it.

    `InputError` if a tissue has no group, or one that the model has seen no study of;
    `SolveError` if no stable law is found.
    """
    parameters = Parameters.of(case)
    if not any(parameters.groups) and all(case.tissues[labels[0]].law is not None for labels in parameters.labels):
        return _declared_prior(case, parameters, seed)
    from warpbrain.gp.trained import trained

    process = trained() if model is None else model
    require_groups(case, [label for labels in parameters.labels for label in labels], process)
    tissues = parameters.groups, parameters.laws_of, parameters.poisson, parameters.formulations
    return _prior_of_tissues(process, *tissues, _DRAWS, seed)


#: A diagnosis and its estimates ask for one prior several times, and 500 draws take a second.
_prior_of_tissues = lru_cache(maxsize=8)(Prior.of)


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
    least = (_NARROWEST * np.where(np.isfinite(ranges), ranges, 0.0)) ** 2
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
