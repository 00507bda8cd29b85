"""Covariance of secant moduli: what studies share, level by level.

With `z = ln mu(l)` of a study of method `m`, anatomy `a`, paper `q`, and `x(l) = 0.5 tanh(e(l)/0.5)` of the equivalent
strain `e` (`literature.study`), which is `l - 1` near rest and of equal size for tension and compression of one I1,

    z = ln 1500 Pa + overall + method + anatomy + group + paper + study                       one modulus each
        + [curve shared by all + by anatomy + by paper + of the study](x), even, 0 at rest    hyperelastic studies only
        + 2 a x + [asymmetry of the paper + of the study](x), odd in x                        asymmetric studies only
        + (b + [asymmetry at rest of the paper + of the study]) sgn(x)                        asymmetric studies only
        + rest

each a Gaussian effect with a variance of its own: a sum of coregionalised kernels whose matrices are "is the same". The
kernel over `x` is stationary; curves take its even part, given that they are zero at rest, and asymmetries its odd one.
`a` and `b` are what asymmetry is in the mean over papers: unknown, one pair for all tissue, as likely positive as
negative before the data are seen.
Elastography and linear studies publish a modulus, not a curve, so they inform the modulus only. A form of I1 alone that
was fitted to both sides at once (neo-Hookean, Fung, Gent, Demiray, Yeoh) is symmetric whatever was measured, so such a
study has no asymmetry and informs none. Grey and white matter of one paper, or of one new subject, are correlated
through all that is shared: overall, method and paper.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.errors import SolveError
from warpbrain.gp.literature.study import (
    ANATOMIES,
    GROUPS,
    METHODS,
    Study,
    equivalent_strain,
    groups_of,
    log_energy,
    log_secant_modulus,
)
from warpbrain.gp.process import KERNELS, Draws, standard_normal

#: A curve of a hyperelastic study is seen at this many stretches. It has one to eight parameters: a hundred points of
#: it are not a hundred observations.
STRETCHES = 10
#: About which moduli lie [Pa], and how widely (standard deviation of the logarithm): weak, and not learnt.
CENTRE, OVERALL = np.log(1500.0), 3.0
#: Standard deviations of `a` and `b` before the data are seen: weak, and not learnt. A standard deviation of `a` makes
#: large tension stiffer or softer than compression by a factor of 7, one of `b` by 2.7 from the smallest strain on.
MEAN_ASYMMETRY = (1.0, 0.5)
#: Bound of the strain that curves are over: a little beyond what the literature has (-0.48 to 0.40). Beyond the data
#: moduli end changing, so that energies go on as neo-Hookean ones there.
REACH = 0.5

#: Effects that make a modulus change with strain, and differ between tension and compression.
OF_CURVES = ("curve", "curve, anatomy", "curve, paper", "curve, study")
OF_SIDES = ("asymmetry, paper", "asymmetry, study", "asymmetry at rest, paper", "asymmetry at rest, study")
#: Effects and what their standard deviation is thought to be before the data are seen: the median of a log-normal prior
#: whose logarithm has the standard deviation `PRIOR_SPREAD`.
EFFECTS = {
    "method": 0.7,
    "anatomy": 0.5,
    "group": 0.5,
    "paper": 0.7,
    **{f"study, {method}": 0.7 for method in METHODS},
    "study, abnormal": 1.0,
    **dict.fromkeys(OF_CURVES, 0.5),
    **dict.fromkeys(OF_SIDES, 0.3),
}
PRIOR_SPREAD = 1.0
#: Standard deviation of what is left of a log modulus, not learnt: a published formula is not its data. Below 3 % the
#: agreement of a formula with a smooth curve says nothing of tissue, and would make the covariance singular.
REST = 0.03
#: Of the length scale of the curves, in strain.
LENGTH, LENGTH_SPREAD = 0.5, 0.5


@dataclass(frozen=True, eq=False)
class Places:
    """Where secant moduli are looked at, (n,) each.

    `study` and `source`, its paper, are numbers that tell them apart (negative: new ones), `task` is the group. Where
    the form of a study takes tension and compression alike (`Study.symmetric`) it says nothing of asymmetry.
    """

    study: Ints
    source: Ints
    task: Ints
    stretch: Floats
    symmetric: Bools

    @property
    def asymmetric(self) -> Bools:
        """Curved, and free to be stiffer on one side of rest."""
        return self.curved & ~self.symmetric

    @property
    def curved(self) -> Bools:
        """Hyperelastic: elsewhere only a modulus was published."""
        return self.task // len(ANATOMIES) == METHODS.index("hyperelastic")


@dataclass(frozen=True, eq=False)
class Observations:
    """Secant moduli of studies, `z = ln(Psi / I)` (n,) with moduli in Pa, and where they are."""

    places: Places
    log_modulus: Floats

    @cached_property
    def among(self) -> Structure:
        """Of their places with themselves, which every hierarchy shares."""
        return Structure.of(self.places, self.places)


def observations(studies: Sequence[Study]) -> Observations:
    """Secant moduli: `STRETCHES` for a hyperelastic study, one for another."""
    names = papers(studies)
    grids, moduli = [], [np.empty(0)]
    half = STRETCHES // 2
    middle = (np.arange(half) + 0.5) / half
    for study in studies:
        low, high = study.stretch
        # the middles of equal parts of its range, so that neither 1 nor an end is among them
        curved = np.concatenate([low + (1.0 - low) * middle, 1.0 + (high - 1.0) * middle])
        grid = curved if study.hyperelastic else np.array([low, high])
        values = log_secant_modulus(grid, study.energy(grid))
        grids.append(grid if study.hyperelastic else np.ones(1))
        moduli.append(values if study.hyperelastic else values.mean(keepdims=True))
    curves = [(index, names.index(each.paper), each.task, each.symmetric) for index, each in enumerate(studies)]
    return Observations(places_of(curves, grids), np.concatenate(moduli))


def places_of(curves: Sequence[tuple[int, int, int, bool]], stretches: Sequence[Floats]) -> Places:
    """Places at the stretches of each of some curves, by `study`, `source`, `task` and `symmetric` of each."""
    each = np.array(curves, dtype=np.int64).reshape(-1, 4)
    study, source, task, symmetric = np.repeat(each, [len(at) for at in stretches], axis=0).T
    return Places(study, source, task, np.concatenate([np.empty(0), *stretches]), symmetric == 1)


def papers(studies: Sequence[Study]) -> list[str]:
    """The papers that studies are from; the place of one is its number in `Places.source`."""
    return sorted({study.paper for study in studies})


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """Standard deviations of `EFFECTS`, the length scale of the curves and their kernel, a key of `KERNELS`.

    `mean_asymmetry` has the standard deviations of `a` and `b` before the data are seen; zero for a model without.
    """

    spread: dict[str, float]
    length_scale: float
    kernel: str = "matern52"
    mean_asymmetry: tuple[float, float] = MEAN_ASYMMETRY

    def to_vector(self) -> Floats:
        """Logarithms, the length scale last."""
        return np.log([*(self.spread[name] for name in EFFECTS), self.length_scale])

    @classmethod
    def from_vector(
        cls, vector: Floats, kernel: str = "matern52", mean_asymmetry: tuple[float, float] = MEAN_ASYMMETRY
    ) -> Hierarchy:
        values = np.exp(vector).tolist()
        return cls(dict(zip(EFFECTS, values[:-1], strict=True)), values[-1], kernel, mean_asymmetry)

    def covariance(self, structure: Structure) -> Floats:
        """Covariance (n, m) of the moduli at two sets of places, without the rest."""
        even, odd, _, _ = self._curves(structure)
        curves = even * self._sum(structure.even) + odd * self._sum(structure.odd)
        mean = structure.a * np.square(self.mean_asymmetry) @ structure.b.T
        return np.asarray(OVERALL**2 + mean + self._sum(structure.constant) + curves)

    def slopes(self, structure: Structure, weights: Floats) -> Floats:
        """Derivatives by the vector of the sum of the covariance times weights (n, m)."""
        even, odd, d_even, d_odd = self._curves(structure)
        parts = ((structure.constant, weights), (structure.even, weights * even), (structure.odd, weights * odd))
        by = {name: np.vdot(matrix, along) for matrices, along in parts for name, matrix in matrices.items()}
        by_length = np.vdot(weights, d_even * self._sum(structure.even) + d_odd * self._sum(structure.odd))
        return np.array([*(2.0 * self.spread[name] ** 2 * by[name] for name in EFFECTS), by_length])

    def _sum(self, matrices: Mapping[str, Floats]) -> Floats:
        return np.asarray(sum(self.spread[name] ** 2 * matrix for name, matrix in matrices.items()))

    def _curves(self, structure: Structure) -> tuple[Floats, Floats, Floats, Floats]:
        """Even and odd part of the kernel, and their derivatives by the logarithm of the length scale.

        The even part is that of curves which are zero at rest, `k(x, y) - k(x, 0) k(0, y) / k(0, 0)`: what a modulus is
        at rest the effects of moduli say, and curves what it becomes with strain.
        """
        x, y = structure.x, structure.y
        near, mirrored, rest_x, rest_y = (
            KERNELS[self.kernel](np.abs(away), self.length_scale) for away in (x[:, None] - y, x[:, None] + y, x, y)
        )
        d_rest = np.outer(rest_x[1], rest_y[0]) + np.outer(rest_x[0], rest_y[1])
        return (
            0.5 * (near[0] + mirrored[0]) - np.outer(rest_x[0], rest_y[0]),
            0.5 * (near[0] - mirrored[0]),
            0.5 * (near[1] + mirrored[1]) - d_rest,
            0.5 * (near[1] - mirrored[1]),
        )


@dataclass(frozen=True, eq=False)
class Structure:
    """What of the covariance between two sets of places does not depend on the hierarchy.

    `constant`, `even` and `odd` are matrices (n, m) of each effect for unit variance; those of curves and asymmetries
    are still to be multiplied by the even and the odd part of the kernel over the bounded strains `x` (n,) and `y`
    (m,); `a` (n, 2) and `b` (m, 2) see `mean_asymmetry_of`.
    """

    constant: dict[str, Floats]
    even: dict[str, Floats]
    odd: dict[str, Floats]
    x: Floats
    y: Floats
    a: Floats
    b: Floats

    @classmethod
    def of(cls, a: Places, b: Places) -> Structure:
        count = len(ANATOMIES)
        method_a, method_b = a.task // count, b.task // count
        same = {"anatomy": _same(a.task % count, b.task % count), "paper": _same(a.source, b.source)}
        same["study"] = study = _same(a.study, b.study)
        abnormal = (a.task % count == ANATOMIES.index("abnormal")).astype(float)[:, None]
        constant = {"method": _same(method_a, method_b), "anatomy": same["anatomy"], "group": _same(a.task, b.task)}
        constant |= {"paper": same["paper"], "study, abnormal": study * abnormal}
        for index, method in enumerate(METHODS):
            constant[f"study, {method}"] = study * (1.0 - abnormal) * (method_a == index)[:, None]
        x, y = bounded_strain(a.stretch), bounded_strain(b.stretch)
        curved = np.outer(a.curved, b.curved).astype(float)
        both = np.outer(a.asymmetric, b.asymmetric).astype(float)
        sides = both * np.outer(np.sign(x), np.sign(y))
        constant |= {f"asymmetry at rest, {level}": same[level] * sides for level in ("paper", "study")}
        even = {"curve": curved} | {f"curve, {level}": matrix * curved for level, matrix in same.items()}
        odd = {f"asymmetry, {level}": same[level] * both for level in ("paper", "study")}
        return cls(constant, even, odd, x, y, mean_asymmetry_of(a), mean_asymmetry_of(b))


def mean_asymmetry_of(at: Places) -> Floats:
    """What `a` and `b` are multiplied by at places (n, 2)."""
    x = bounded_strain(at.stretch)
    return np.stack([x / REACH, np.sign(x)], axis=1) * at.asymmetric[:, None]


def bounded_strain(stretches: Floats) -> Floats:
    """`REACH tanh(e / REACH)` of the equivalent strain `e`."""
    return np.asarray(REACH * np.tanh(equivalent_strain(stretches) / REACH))


def prior() -> tuple[Floats, Floats]:
    """Mean and standard deviation of `Hierarchy.to_vector` before the data are seen."""
    mean = np.log([*EFFECTS.values(), LENGTH])
    return mean, np.array([*[PRIOR_SPREAD] * len(EFFECTS), LENGTH_SPREAD])


def _same(a: Ints, b: Ints) -> Floats:
    return (a[:, None] == b[None, :]).astype(float)


#: Hierarchies of a sample, unless said otherwise.
SAMPLE = 24
#: Standard deviation of an effect that is left out.
_NONE = 1e-6
#: Step in a logarithm by which curvatures are differenced from gradients.
_STEP = 1e-4


@dataclass(frozen=True)
class Fitted:
    """How the fit of a hierarchy ended."""

    objective: float  # negative log of likelihood times prior
    converged: bool
    message: str
    iterations: int
    condition: float  # of the covariance of the observations, in the 2-norm


def fit_hierarchy(
    seen: Observations,
    kernel: str = "matern52",
    first: Hierarchy | None = None,
    without: Sequence[str] = (),
    mean_asymmetry: tuple[float, float] = MEAN_ASYMMETRY,
) -> tuple[Hierarchy, Fitted]:
    """The hierarchy of largest posterior density, climbed to from `first`, or the median of the prior.

    Effects it is `without`, for comparisons, have a standard deviation of 1e-6. `SolveError` if the covariance cannot
    be factored at the start.
    """
    from scipy.optimize import minimize

    mean, spread = prior()
    start = mean if first is None else first.to_vector()
    fixed = np.array([name in without for name in EFFECTS] + [False])
    start = np.where(fixed, np.log(_NONE), start)

    def objective(vector: Floats) -> tuple[float, Floats]:
        hierarchy = Hierarchy.from_vector(vector, kernel, mean_asymmetry)
        value, gradient = negative_log_likelihood(hierarchy, seen)
        away = np.where(fixed, 0.0, (vector - mean) / spread)
        gradient = np.where(fixed, 0.0, gradient)
        return value + 0.5 * float(away @ away), gradient + away / spread

    end = minimize(objective, start, jac=True, method="L-BFGS-B", options={"maxiter": 200, "ftol": 1e-9})
    if not np.isfinite(end.fun):
        raise SolveError("the covariance of the studies is not positive definite in double precision")
    hierarchy = Hierarchy.from_vector(end.x, kernel, mean_asymmetry)
    condition = float(np.linalg.cond(hierarchy.covariance(seen.among) + REST**2 * np.eye(len(seen.log_modulus))))
    return hierarchy, Fitted(float(end.fun), bool(end.success), str(end.message), int(end.nit), condition)


def sample_hierarchies(best: Hierarchy, seen: Observations, count: int) -> tuple[Hierarchy, ...]:
    """Hierarchies that the data allow, drawn by Laplace's approximation of the posterior of their logarithms.

    Thirty papers do not say how far papers differ to more than some tens of per cent, and of some effects hardly
    anything: predictions by the best hierarchy alone are too sure. Priors are log-normal, so where data say little the
    posterior is normal in the logarithms already. Draws come in pairs on opposite sides of the best, of largest
    posterior density; effects that it lacks stay out.
    """
    centre = best.to_vector()
    _, spread = prior()
    free = centre > np.log(2.0 * _NONE)
    curvature = np.diag(spread**-2.0)
    _, here = negative_log_likelihood(best, seen)
    for k in np.flatnonzero(free):
        ahead = Hierarchy.from_vector(centre + _STEP * np.eye(len(centre))[k], best.kernel, best.mean_asymmetry)
        curvature[:, k] += (negative_log_likelihood(ahead, seen)[1] - here) / _STEP
    values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T)[np.ix_(free, free)])
    # the posterior is no wider than the prior along any direction
    root = vectors / np.sqrt(np.maximum(values, 1.0 / spread.max() ** 2))
    normal = np.random.default_rng(0).standard_normal(((count + 1) // 2, len(values)))
    vectors = np.tile(centre, (count, 1))
    vectors[:, free] += np.concatenate([normal, -normal])[:count] @ root.T
    return tuple(Hierarchy.from_vector(vector, best.kernel, best.mean_asymmetry) for vector in vectors)


def negative_log_likelihood(hierarchy: Hierarchy, seen: Observations) -> tuple[float, Floats]:
    """Of observations, with its derivative by `Hierarchy.to_vector`; infinite if the covariance cannot be factored."""
    from scipy.linalg import cho_solve, cholesky

    identity = np.eye(len(seen.log_modulus))
    away = seen.log_modulus - CENTRE
    try:
        L = cholesky(hierarchy.covariance(seen.among) + REST**2 * identity, lower=True)
    except np.linalg.LinAlgError:
        return np.inf, np.zeros(len(EFFECTS) + 1)
    weights = cho_solve((L, True), away)
    G = 0.5 * (cho_solve((L, True), identity) - np.outer(weights, weights))
    value = 0.5 * float(away @ weights) + float(np.log(np.diag(L)).sum()) + 0.5 * len(away) * np.log(2.0 * np.pi)
    return value, hierarchy.slopes(seen.among, G)


#: Stretches at which draws are drawn; between them they are the mean given these values.
ANCHORS = np.linspace(0.4, 1.8, 57)


@dataclass(frozen=True, eq=False)
class Conditional:
    """The normal distribution of log moduli under a hierarchy, given observations."""

    hierarchy: Hierarchy
    seen: Observations

    def moments(self, at: Structure, other: Structure, between: Structure) -> tuple[Floats, Floats]:
        """Mean at places (n,) and covariance with other places (n, m).

        By the structures of observations with places and with other places, and between the two.
        """
        k = self._whitened(self.hierarchy.covariance(at))
        to = k if other is at else self._whitened(self.hierarchy.covariance(other))
        return CENTRE + k.T @ self._factored[1], self.hierarchy.covariance(between) - k.T @ to

    def mean_asymmetry(self) -> tuple[Floats, Floats]:
        """Mean (2,) and covariance (2, 2) of `a` and `b`, the asymmetry of all papers in the mean."""
        prior = np.diag(np.square(self.hierarchy.mean_asymmetry))
        k = self._whitened(mean_asymmetry_of(self.seen.places) @ prior)
        return k.T @ self._factored[1], prior - k.T @ k

    def _whitened(self, covariance: Floats) -> Floats:
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self._factored[0], covariance, lower=True))

    @cached_property
    def _factored(self) -> tuple[Floats, Floats]:
        """The factor of the covariance of the observations, and what it makes of them."""
        from scipy.linalg import cholesky, solve_triangular

        among = self.hierarchy.covariance(self.seen.among)
        L = cholesky(among + REST**2 * np.eye(len(among)), lower=True)
        return L, solve_triangular(L, self.seen.log_modulus - CENTRE, lower=True)


@dataclass(frozen=True, eq=False)
class Hierarchical:
    """The hierarchical model of a set of studies (a `warpbrain.gp.process.Process`): they differ as wholes.

    The paper's process takes what studies of a group differ by for noise that is independent at every stretch. A
    hundred points of five curves then pin the group down as five hundred observations would, and a joint draw is
    jagged. Here a study, and the paper it is from, is an effect, so the spread of a new study is one of whole curves.

    `hierarchy` is that of largest posterior density, `sample` was drawn from the posterior: predictions are averaged
    over it, and a draw is of one of it. Where it is empty, `hierarchy` stands for all.
    """

    studies: tuple[Study, ...]
    hierarchy: Hierarchy
    variant: str = "corrected"
    sample: tuple[Hierarchy, ...] = ()
    folder: Path | None = None
    name = "hierarchical"

    @classmethod
    def fitted(
        cls, studies: Sequence[Study], variant: str, kernel: str = "matern52", sample: int = SAMPLE, **how: Any
    ) -> tuple[Hierarchical, Fitted]:
        """The model of studies with a sample of hierarchies, and how its fit ended; `how` is of `fit_hierarchy`."""
        seen = observations(studies)
        hierarchy, fitted = fit_hierarchy(seen, kernel, **how)
        drawn = sample_hierarchies(hierarchy, seen, sample) if sample else ()
        return cls(tuple(studies), hierarchy, variant, drawn), fitted

    @property
    def groups(self) -> tuple[str, ...]:
        return groups_of(self.studies)

    def modulus(self, groups: Sequence[str], stretches: ArrayLike) -> tuple[Floats, Floats]:
        """Mean (groups, n) and covariance (groups * n, groups * n) of the log secant modulus of a new study.

        All groups are measured by one new paper, as in one subject.
        """
        return _modulus(self, tuple(groups), tuple(np.asarray(stretches, dtype=np.float64).tolist()))

    def moduli_of(self, studies: Sequence[Study], stretches: Sequence[Floats]) -> list[tuple[Floats, Floats]]:
        """Mean and covariance, under each hierarchy, of log secant moduli of studies that it has not seen.

        Joint over studies, each at its own stretches. Where it has seen others of the same paper, these count.
        """
        known = papers(self.studies)
        new = sorted({study.paper for study in studies} - set(known))
        sources = {**{name: index for index, name in enumerate(known)}, **{n: -1 - k for k, n in enumerate(new)}}
        curves = [(-1 - index, sources[each.paper], each.task, each.symmetric) for index, each in enumerate(studies)]
        return self.moments(places_of(curves, stretches))

    def moments(self, at: Places) -> list[tuple[Floats, Floats]]:
        """Mean (n,) and covariance (n, n) of the log secant modulus at places, under each hierarchy."""
        here, among = Structure.of(self._seen.places, at), Structure.of(at, at)
        return [each.moments(here, here, among) for each in self.conditionals]

    @staticmethod
    def places(groups: Sequence[str], stretches: ArrayLike) -> Places:
        """Places (groups * n) of one new paper, with one new study a group, free to be asymmetric."""
        l = np.asarray(stretches, dtype=np.float64)
        curves = [(-1 - index, -1, GROUPS.index(group), False) for index, group in enumerate(groups)]
        return places_of(curves, [l] * len(groups))

    def curve(self, group: str, stretches: ArrayLike, k: ArrayLike = 0.0) -> Floats:
        """The curve `k` standard deviations from the mean, see `Process`."""
        mean, covariance = self.modulus([group], stretches)
        away = np.multiply.outer(np.asarray(k, dtype=np.float64), np.sqrt(np.diag(covariance)))
        return log_energy(stretches, mean[0] + away)

    def draw(self, groups: Sequence[str], stretches: ArrayLike, number: int | tuple[int, ...], seed: int = 0) -> Floats:
        from scipy.special import ndtr

        l = np.asarray(stretches, dtype=np.float64)
        normal = standard_normal(1 + len(groups) * len(ANCHORS), number, seed)
        which = min(int(ndtr(normal[0]) * len(self.conditionals)), len(self.conditionals) - 1)

        def moments(groups: tuple[str, ...], at: Floats, other: Floats) -> tuple[Floats, Floats]:
            seen, here, there = self._seen.places, self.places(groups, at), self.places(groups, other)
            to = Structure.of(seen, here)
            to_others = to if other is at else Structure.of(seen, there)
            return self.conditionals[which].moments(to, to_others, Structure.of(here, there))

        return log_energy(l, self._draws[which].at(tuple(groups), l, normal[1:], moments))

    @cached_property
    def _draws(self) -> tuple[Draws, ...]:
        return tuple(Draws(ANCHORS) for _ in self.conditionals)

    @cached_property
    def _seen(self) -> Observations:
        return observations(self.studies)

    @cached_property
    def conditionals(self) -> tuple[Conditional, ...]:
        """What is known of moduli under each hierarchy of the sample."""
        return tuple(Conditional(hierarchy, self._seen) for hierarchy in self.sample or (self.hierarchy,))


# several curves of a group are asked for, and laws fitted to each
@lru_cache(maxsize=len(GROUPS))
def _modulus(model: Hierarchical, groups: tuple[str, ...], stretches: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Mean (g, k) and covariance (g k, g k) of the moduli of groups at stretches (k,); see `Hierarchical`."""
    moments = model.moments(model.places(groups, stretches))
    means = np.array([mean for mean, _ in moments])
    # of a mixture of distributions of equal weight
    away = means - means.mean(axis=0)
    within = np.mean([covariance for _, covariance in moments], axis=0)
    return means.mean(axis=0).reshape(len(groups), -1), within + away.T @ away / len(moments)
