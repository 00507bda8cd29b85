"""What the literature says of the parameters of laws before anything of a patient is known."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats, Ints
from warpbrain.errors import InputError
from warpbrain.gp.process import Process
from warpbrain.gp.sampling import DrawnLaws, draw_laws

if TYPE_CHECKING:
    from warpbrain.physics.laws import Law
    from warpbrain.physics.laws.law import Coordinate


def coordinates(law: str) -> tuple[Coordinate, ...]:
    """Of a law by its name in `case.toml`, Ogden's of one term; `InputError` if none that has a prior is called so."""
    from warpbrain.physics.laws import LAWS

    known = {name: kind.coordinates for name, kind in LAWS.items() if kind.coordinates}
    if law not in known:
        raise InputError(f"law '{law}': expected one of {', '.join(known)}")
    return known[law]


def to_coordinates(law: Law) -> tuple[float, ...]:
    """Coordinates of a law; `InputError` if it has none, or several terms."""
    coordinates(law.name)
    return math.log(law.shear_modulus), *law.shape


def from_coordinates(law: str, values: Sequence[float]) -> Law:
    """The law of its coordinates; `InputError` if there are not as many as it has, or there is no such law."""
    from warpbrain.physics.laws import LAWS

    known = coordinates(law)
    if len(values) != len(known):
        names = ", ".join(coordinate.name for coordinate in known)
        raise InputError(f"{law}: found {len(values)} numbers, expected {len(known)}: {names}")
    kind: Any = LAWS[law]
    return kind.of_shear_modulus(math.exp(values[0]), *values[1:])


def laws_from(names: Sequence[str], values: Sequence[float]) -> tuple[Law, ...]:
    """Laws by their names, of the coordinates of all of them, one after the other."""
    rest = iter(values)
    return tuple(from_coordinates(name, list(islice(rest, len(coordinates(name))))) for name in names)


#: Smallest width of a kernel along a bounded coordinate, relative to the box: where all samples are on one side, their
#: spread gives none.
NARROWEST = 0.01


@dataclass(frozen=True, eq=False)
class Prior:
    """A distribution of the laws of one or several tissues.

    A vector `theta` (p,) holds for each tissue `ln(mu0 / Pa)`, then for Mooney-Rivlin the ratio `C2 / (C1 + C2)`, for
    Ogden the exponent `alpha`. The distribution is that of stable laws: draws that are not are drawn again
    (`warpbrain.gp.sampling`), and `rejection_rate` says how many.

    Where a curve wants a negative coefficient, Mooney-Rivlin's ratio is 0 or 1 but for the 0.1 Pa that the fit leaves
    the coefficient: that is a mass on a side, which the samples have, which `at_bound` states, and which `log_density`
    spreads inwards a little. Ogden's stable exponents lie above 1 and below -2: those of different signs are clusters.
    Of both shapes the Gaussian approximation is a poor one, and `distances` says how poor.

    Attributes
    ----------
    model : Process
    groups : tuple of str
        One for each tissue, all different.
    laws_of : tuple of str
        Name of the law of each tissue.
    poisson, formulation : float, str or tuple of str
        With which the laws are stable; one formulation for all tissues, or one for each.
    seed : int
    theta : (n, p) array
        Draws 0 to n - 1 of the seed, on which all but `samples` rests.
    attempts : int
        That these draws took.
    at_bound : (groups,) array
        Part of the draws in which the fit of a tissue lies at a bound of its parameters.
    """

    model: Process
    groups: tuple[str, ...]
    laws_of: tuple[str, ...]
    poisson: float
    formulation: str | tuple[str, ...]
    seed: int
    theta: Floats
    attempts: int
    at_bound: Floats

    @classmethod
    def of(
        cls,
        model: Process,
        groups: Sequence[str],
        law: str | Sequence[str],
        poisson: float = 0.45,
        formulation: str | tuple[str, ...] = "coupled",
        count: int = 1000,
        seed: int = 0,
    ) -> Prior:
        """The prior of tissues of different groups, with one law for all of them or one for each, from `count` draws.

        Raises
        ------
        InputError
            If a group is given twice or the model has seen no study of it, there is no such law, or count is too small.
        SolveError
            If no stable law is found.

        Examples
        --------
        >>> from warpbrain.gp.trained import trained
        >>> prior = Prior.of(trained(), ["hyperelastic/brain"], "neo-hookean", count=100)
        >>> prior.names
        ('hyperelastic/brain: ln(mu0 / Pa)',)
        """
        names = (law,) * len(groups) if isinstance(law, str) else tuple(law)
        size = sum(len(coordinates(name)) for name in names)
        if len(set(groups)) < len(groups):
            raise InputError(f"groups {', '.join(groups)}: one is given twice; tissues of one group are one tissue")
        if count < 10 * size:
            raise InputError(f"count {count}: expected at least {10 * size} draws for {size} parameters")
        draws = [draw_laws(model, groups, names, number, seed, poisson, formulation) for number in range(count)]
        attempts = sum(1 + len(drawn.rejected) for drawn in draws)
        at_bound = np.mean([[bool(fitted.at_bound) for fitted in drawn.fits] for drawn in draws], axis=0)
        return cls(model, tuple(groups), names, poisson, formulation, seed, _theta(draws), attempts, at_bound)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters, with group and unit."""
        return tuple(f"{group}: {coordinate.name}" for group, coordinate in self._coordinates)

    @property
    def rejection_rate(self) -> float:
        """Part of the attempts that gave an unstable law."""
        return 1.0 - len(self.theta) / self.attempts

    def samples(self, count: int, seed: int | None = None) -> Floats:
        """Draws 0 to `count` - 1 of a seed (the prior's own unless given), shape (count, p)."""
        drawn = self.seed if seed is None else seed
        if drawn == self.seed and count <= len(self.theta):
            return self.theta[:count].copy()
        about = self.model, self.groups, self.laws_of
        return _theta([draw_laws(*about, k, drawn, self.poisson, self.formulation) for k in range(count)])

    @cached_property
    def mean(self) -> Floats:
        """Of the Gaussian approximation, shape (p,)."""
        return self.theta.mean(axis=0)

    @cached_property
    def covariance(self) -> Floats:
        """Of the Gaussian approximation, shape (p, p)."""
        return np.atleast_2d(np.cov(self.theta, rowvar=False))

    @cached_property
    def distances(self) -> Floats:
        """Largest difference (p,) between the distribution functions of each parameter's draws and of its Gaussian.

        0 is a Gaussian, 1 is as far as can be. Of n draws of a Gaussian it is about `0.6 / sqrt(n)`, 0.02 for 1000.
        """
        from scipy.stats import kstest

        away = (self.theta - self.mean) / np.sqrt(np.diag(self.covariance))
        return np.array([kstest(column, "norm").statistic for column in away.T])

    def log_density(self, theta: ArrayLike) -> Floats | float:
        """Log density of the draws by `theta`: a number for (p,), an array (m,) for (m, p); see `FoldedDensity`."""
        density = self._density.log_density(self._points(theta))
        return density if np.ndim(theta) > 1 else float(density[0])

    def laws(self, theta: ArrayLike) -> tuple[Law, ...]:
        """The law of each tissue at a vector (p,).

        Raises
        ------
        InputError
            If it is not as long as there are parameters, or is of no law.
        """
        [point] = self._points(theta)
        return laws_from(self.laws_of, point.tolist())

    def _points(self, theta: ArrayLike) -> Floats:
        points = np.atleast_2d(np.asarray(theta, dtype=np.float64))
        if points.ndim != 2 or points.shape[1] != len(self.names):
            raise InputError(f"theta of shape {np.shape(theta)}: expected {len(self.names)}: {', '.join(self.names)}")
        return points

    @property
    def _coordinates(self) -> list[tuple[str, Coordinate]]:
        pairs = zip(self.groups, self.laws_of, strict=True)
        return [(group, coordinate) for group, name in pairs for coordinate in coordinates(name)]

    @cached_property
    def _density(self) -> FoldedDensity:
        listed = [coordinate for _, coordinate in self._coordinates]
        low, high = (np.array([getattr(coordinate, side) for coordinate in listed]) for side in ("low", "high"))
        signed = [coordinate.signed for coordinate in listed]
        negative = (self.theta[:, signed] < 0.0).astype(np.int64)
        clusters = negative @ (2 ** np.arange(negative.shape[1]))
        return FoldedDensity(self.theta, low, high, clusters)


@dataclass(frozen=True, eq=False)
class FoldedDensity:
    """The kernel density of samples (n, p), folded back into a box with sides `low` and `high` (p,), some of them
    infinite.

    Gaussian kernels have the covariance of the samples times Scott's `n^(-2 / (p + 4))`. What of a kernel lies beyond
    a side is mirrored in it, so the density is one on the box and does not sink towards its sides. Samples that pile up
    on a side, as parameters at a bound of a fit do, are a mass there that no density holds: it is spread inwards over
    the width of a kernel. Where samples fall apart into clusters, they are told apart by `clusters` (n,), and the
    covariance is that within them: a kernel as wide as the gap between two would fill it.
    """

    samples: Floats
    low: Floats
    high: Floats
    clusters: Ints

    def log_density(self, at: ArrayLike) -> Floats:
        """Log density (m,) at points (m, p); minus infinity outside of the box."""
        from scipy.linalg import solve_triangular
        from scipy.special import logsumexp

        points = np.atleast_2d(np.asarray(at, dtype=np.float64))
        count, size = self.samples.shape
        centres = solve_triangular(self._factor, self.samples.T, lower=True).T
        # the points and their mirror images in all sides; a kernel is narrow: images of images are of no weight
        by_column = [
            [column, *(2.0 * side - column for side in sides if np.isfinite(side))]
            for column, *sides in zip(points.T, self.low, self.high, strict=True)
        ]
        terms = []
        for image in product(*by_column):
            away = solve_triangular(self._factor, np.stack(image), lower=True).T
            squares = np.sum(away**2, axis=1)[:, None] - 2.0 * away @ centres.T + np.sum(centres**2, axis=1)
            terms.append(logsumexp(-0.5 * squares, axis=1))
        density: Floats = logsumexp(terms, axis=0)
        density -= np.log(count) + 0.5 * size * np.log(2.0 * np.pi) + np.log(np.diag(self._factor)).sum()
        inside = np.all((points >= self.low) & (points <= self.high), axis=1)
        return np.where(inside, density, -np.inf)

    @cached_property
    def _factor(self) -> Floats:
        """Cholesky factor of the covariance of a kernel."""
        count, size = self.samples.shape
        away = self.samples.copy()
        for cluster in np.unique(self.clusters):
            away[self.clusters == cluster] -= away[self.clusters == cluster].mean(axis=0)
        covariance = away.T @ away / count * count ** (-2.0 / (size + 4.0))
        bounded = np.isfinite(self.high - self.low)
        widest = np.where(bounded, NARROWEST * np.where(bounded, self.high - self.low, 1.0), 0.0)
        missing = np.maximum(widest**2 - np.diag(covariance), 0.0)
        return np.linalg.cholesky(covariance + np.diag(missing))


def _theta(draws: Iterable[DrawnLaws]) -> Floats:
    """Parameters (n, p) of draws."""
    return np.array([[value for law in drawn.laws for value in to_coordinates(law)] for drawn in draws])
