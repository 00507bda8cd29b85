"""The hierarchical model: studies differ as wholes, not point by point.

The paper's process takes what studies of a group differ by for noise that is independent at every stretch. A hundred
points of five curves then pin the group down as five hundred observations would, and a joint draw is jagged. Here a
study, and the paper it is from, is an effect (`hierarchy`), so the spread of a new study is a spread of whole curves.
How far studies and papers differ is itself known from few: predictions are averaged over a sample of hierarchies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.gp.hierarchy import (
    CENTRE,
    REST,
    Hierarchy,
    Observations,
    Places,
    Structure,
    mean_asymmetry_of,
    observations,
    papers,
    places_of,
)
from warpbrain.gp.literature.study import GROUPS, Study, groups_of
from warpbrain.gp.process import Draws, standard_normal
from warpbrain.gp.secant import log_energy

#: Stretches at which draws are drawn; between them they are the mean given these values.
ANCHORS = np.linspace(0.4, 1.8, 57)


class Structures(NamedTuple):
    """Structures of observations with places and with other places, and between the two, under any hierarchy."""

    at: Structure
    other: Structure
    between: Structure


@dataclass(frozen=True, eq=False)
class Conditional:
    """The normal distribution of log moduli under a hierarchy, given observations."""

    hierarchy: Hierarchy
    seen: Observations

    def moments(self, structures: Structures) -> tuple[Floats, Floats]:
        """Mean at places (n,) and covariance with other places (n, m)."""
        at, other, between = structures
        k = self._whitened(self.hierarchy.covariance_of(at))
        to = k if other is at else self._whitened(self.hierarchy.covariance_of(other))
        return CENTRE + k.T @ self._factored[1], self.hierarchy.covariance_of(between) - k.T @ to

    def mean_asymmetry(self) -> tuple[Floats, Floats]:
        """Mean (2,) and covariance (2, 2) of `a` and `b`, the asymmetry of all papers in the mean (`hierarchy`)."""
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

        among = self.hierarchy.covariance(self.seen.places, self.seen.places)
        L = cholesky(among + REST**2 * np.eye(len(among)), lower=True)
        return L, solve_triangular(L, self.seen.log_modulus - CENTRE, lower=True)


@dataclass(frozen=True, eq=False)
class Hierarchical:
    """The hierarchical model of a set of studies (a `warpbrain.gp.process.Process`).

    `hierarchy` is that of largest posterior density, `sample` was drawn from the posterior: predictions are averaged
    over it, and a draw is of one of it. Where it is empty, `hierarchy` stands for all.
    """

    studies: tuple[Study, ...]
    hierarchy: Hierarchy
    variant: str = "corrected"
    sample: tuple[Hierarchy, ...] = ()
    name = "hierarchical"
    _structures_of: dict[tuple[Any, ...], Structures] = field(default_factory=dict, init=False, repr=False)

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups that it has seen studies of."""
        return groups_of(self.studies)

    def modulus(self, groups: Sequence[str], stretches: ArrayLike) -> tuple[Floats, Floats]:
        """Mean (groups, n) and covariance (groups * n, groups * n) of the log secant modulus of a new study.

        All groups are measured by one new paper, as in one subject.
        """
        moments = self.moments(self.places(groups, stretches))
        means = np.array([mean for mean, _ in moments])
        # of a mixture of distributions of equal weight
        away = means - means.mean(axis=0)
        within = np.mean([covariance for _, covariance in moments], axis=0)
        return means.mean(axis=0).reshape(len(groups), -1), within + away.T @ away / len(moments)

    def moduli_of(self, studies: Sequence[Study], stretches: Sequence[Floats]) -> list[tuple[Floats, Floats]]:
        """Mean and covariance, under each hierarchy, of log secant moduli of studies that it has not seen.

        Joint over studies, each at its own stretches. Where it has seen others of the same paper, these count.
        """
        known = papers(self.studies)
        new = sorted({study.paper for study in studies} - set(known))
        sources = {**{name: index for index, name in enumerate(known)}, **{n: -1 - k for k, n in enumerate(new)}}
        rows = [
            (-1 - index, sources[study.paper], study.task, l, study.symmetric)
            for index, (study, at) in enumerate(zip(studies, stretches, strict=True))
            for l in at
        ]
        return self.moments(places_of(rows))

    def moments(self, at: Places) -> list[tuple[Floats, Floats]]:
        """Mean (n,) and covariance (n, n) of the log secant modulus at places, under each hierarchy."""
        structures = self._structures(at)
        return [each.moments(structures) for each in self.conditionals]

    def _structures(self, at: Places, other: Places | None = None) -> Structures:
        """Of places with other ones, without these with themselves."""
        here = Structure.of(self._seen.places, at)
        if other is None:
            return Structures(here, here, Structure.of(at, at))
        return Structures(here, Structure.of(self._seen.places, other), Structure.of(at, other))

    @staticmethod
    def places(groups: Sequence[str], stretches: ArrayLike) -> Places:
        """Places (groups * n) of one new paper, with one new study a group, free to be asymmetric."""
        l = np.asarray(stretches, dtype=np.float64)
        numbered = enumerate(map(GROUPS.index, groups))
        return places_of([(-1 - index, -1, task, stretch, False) for index, task in numbered for stretch in l])

    def curve(self, group: str, stretches: ArrayLike, k: ArrayLike = 0.0) -> Floats:
        """The curve `k` standard deviations from the mean, see `Process`."""
        mean, covariance = self.modulus([group], stretches)
        away = np.multiply.outer(np.asarray(k, dtype=np.float64), np.sqrt(np.diag(covariance)))
        return log_energy(stretches, mean[0] + away)

    def draw(self, groups: Sequence[str], stretches: ArrayLike, number: int | tuple[int, ...], seed: int = 0) -> Floats:
        """Draw `number` of a seed, see `Process`."""
        from scipy.special import ndtr

        l = np.asarray(stretches, dtype=np.float64)
        normal = standard_normal(1 + len(groups) * len(ANCHORS), number, seed)
        which = min(int(ndtr(normal[0]) * len(self.conditionals)), len(self.conditionals) - 1)

        def moments(groups: tuple[str, ...], at: Floats, other: Floats) -> tuple[Floats, Floats]:
            return self.conditionals[which].moments(self._kept_structures(groups, at, other))

        return log_energy(l, self._draws[which].at(tuple(groups), l, normal[1:], moments))

    def _kept_structures(self, groups: tuple[str, ...], at: Floats, other: Floats) -> Structures:
        """Structures, which all hierarchies share; the last ones are kept, for many draws at the same stretches."""
        key = groups, at.tobytes(), other.tobytes()
        if key not in self._structures_of:
            if len(self._structures_of) > 1:
                self._structures_of.clear()
            others = None if other is at else self.places(groups, other)
            self._structures_of[key] = self._structures(self.places(groups, at), others)
        return self._structures_of[key]

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
