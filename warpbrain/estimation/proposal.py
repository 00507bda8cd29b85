"""Where the posterior is looked at: around the estimates, with tails that are heavier than its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.estimation.modes import Estimate, probabilities

#: Degrees of freedom of the Student t around each estimate.
_NU = 7.0
#: A mode is looked at however improbable Laplace takes it to be, unless it is less probable than this.
_NEGLIGIBLE, _AT_LEAST = 1e-3, 0.05
#: Draws that tell how much of a t lies where its mode does.
_DRAWS = 4096


@dataclass(frozen=True, eq=False)
class Proposal:
    """A mixture of Student t distributions, one around each estimate, cut off where its mode ends.

    Attributes
    ----------
    modes : tuple of Estimate
    """

    modes: tuple[Estimate, ...]

    @classmethod
    def of(cls, modes: Sequence[Estimate]) -> Proposal:
        """Around those that are probable at all."""
        kept = probabilities(modes) >= _NEGLIGIBLE
        return cls(tuple(mode for mode, keep in zip(modes, kept, strict=True) if keep))

    @cached_property
    def shares(self) -> Floats:
        """Of each mode in the mixture."""
        found = np.maximum(probabilities(self.modes), _AT_LEAST)
        return found / found.sum()

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """Draws (count, p)."""
        found: list[Floats] = []
        for index in rng.choice(len(self.modes), size=count, p=self.shares).tolist():
            mode = self.modes[index]
            inside = False
            while not inside:
                point = self._t(rng, mode, 1)[0]
                inside = bool(self._inside(mode, point[None])[0])
            found.append(point)
        return np.array(found)

    def log_density(self, theta: Floats) -> Floats:
        """Log density (n,) at points (n, p), up to a constant."""
        from scipy.special import logsumexp

        terms = []
        for mode, share, mass in zip(self.modes, self.shares, self._masses, strict=True):
            factor = mode.laplace.posterior.factor
            squares = np.sum(np.linalg.solve(factor, (theta - mode.theta).T) ** 2, axis=0)
            logs = -0.5 * (_NU + theta.shape[1]) * np.log1p(squares / _NU) - float(np.log(np.diag(factor)).sum())
            logs += float(np.log(share / mass))
            terms.append(np.where(self._inside(mode, theta), logs, -np.inf))
        return np.asarray(logsumexp(terms, axis=0), dtype=np.float64)

    @cached_property
    def _masses(self) -> Floats:
        """Part of each t that lies where its mode does."""
        rng = np.random.default_rng(0)
        return np.array([max(self._inside(m, self._t(rng, m, _DRAWS)).mean(), 1.0 / _DRAWS) for m in self.modes])

    @staticmethod
    def _t(rng: np.random.Generator, mode: Estimate, count: int) -> Floats:
        factor = mode.laplace.posterior.factor
        scale = np.sqrt(rng.chisquare(_NU, size=(count, 1)) / _NU)
        return np.asarray(mode.theta + rng.normal(size=(count, len(factor))) / scale @ factor.T)

    @staticmethod
    def _inside(mode: Estimate, theta: Floats) -> Bools:
        prior = mode.problem.mode
        return np.asarray(((theta >= prior.low) & (theta <= prior.high)).all(axis=1))
