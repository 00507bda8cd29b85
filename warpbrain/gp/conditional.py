"""Secant moduli under one hierarchy, given observations of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warpbrain.gp.drawing import Anchored
from warpbrain.gp.hierarchy import CENTRE, REST, Hierarchy, Structure, mean_asymmetry_of
from warpbrain.gp.observations import Observations, Places

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Structures:
    """Covariance structures between observations, places and other places, the same under all hierarchies.

    Attributes
    ----------
    at, other : Structure
        Of the observations with the places, and with the other places.
    between : Structure
        Of the places with the other places.
    """

    at: Structure
    other: Structure
    between: Structure

    @classmethod
    def of(cls, seen: Places, at: Places, other: Places | None = None) -> Structures:
        """Of places of observations, places, and other places; without these of the places among themselves."""
        here = Structure.of(seen, at)
        if other is None:
            return cls(here, here, Structure.of(at, at))
        return cls(here, Structure.of(seen, other), Structure.of(at, other))


@dataclass(frozen=True, eq=False)
class Conditional:
    """The normal distribution of log moduli under a hierarchy, given observations.

    Attributes
    ----------
    hierarchy : Hierarchy
    seen : Observations
    """

    hierarchy: Hierarchy
    seen: Observations

    def moments(self, structures: Structures) -> tuple[Floats, Floats]:
        """Mean at places (n,) and covariance with other places (n, m)."""
        _, away = self._factored
        k = self._whitened(structures.at)
        to = k if structures.other is structures.at else self._whitened(structures.other)
        return CENTRE + k.T @ away, self.hierarchy.covariance_of(structures.between) - k.T @ to

    def mean_asymmetry(self) -> tuple[Floats, Floats]:
        """Mean (2,) and covariance (2, 2) of `a` and `b`, the asymmetry of all papers in the mean (`hierarchy`)."""
        from scipy.linalg import solve_triangular

        L, away = self._factored
        prior = np.diag(np.square(self.hierarchy.mean_asymmetry))
        k = solve_triangular(L, mean_asymmetry_of(self.seen.places) @ prior, lower=True)
        return k.T @ away, prior - k.T @ k

    def anchored(self, key: tuple[str, ...], anchors: Structures) -> Anchored:
        """The distribution at anchors, kept by a key."""
        if key not in self._anchored:
            self._anchored[key] = Anchored(*self.moments(anchors))
        return self._anchored[key]

    def from_anchors(self, key: tuple[tuple[str, ...], bytes], anchors: Structures) -> tuple[Floats, Floats]:
        """Mean and covariance with the anchors; the last ones are kept by a key, for many draws at the same places."""
        if key not in self._last:
            self._last.clear()
            self._last[key] = self.moments(anchors)
        return self._last[key]

    def _whitened(self, to: Structure) -> Floats:
        from scipy.linalg import solve_triangular

        L, _ = self._factored
        return np.asarray(solve_triangular(L, self.hierarchy.covariance_of(to), lower=True))

    @cached_property
    def _factored(self) -> tuple[Floats, Floats]:
        """The factor of the covariance of the observations, and what it makes of them."""
        from scipy.linalg import cholesky, solve_triangular

        among = self.hierarchy.covariance(self.seen.places, self.seen.places)
        L = cholesky(among + REST**2 * np.eye(len(among)), lower=True)
        return L, solve_triangular(L, self.seen.log_modulus - CENTRE, lower=True)

    @cached_property
    def _anchored(self) -> dict[tuple[str, ...], Anchored]:
        return {}

    @cached_property
    def _last(self) -> dict[tuple[tuple[str, ...], bytes], tuple[Floats, Floats]]:
        return {}
