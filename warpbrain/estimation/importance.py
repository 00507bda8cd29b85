"""The check of Laplace's approximation: equilibria of some draws of it, weighed by the posterior itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.laplace import Laplace
from warpbrain.estimation.pareto import RELIABLE, Smoothed, pareto_smoothed
from warpbrain.estimation.proposal import Proposal
from warpbrain.estimation.target import Target

#: Laplace holds if weighted draws put the mean no farther away than this, in standard deviations, and the standard
#: deviations in this ratio or its inverse.
_SHIFT, _RATIO = 0.5, 1.4


@dataclass(frozen=True, eq=False)
class Importance:
    """Weighted draws.

    Attributes
    ----------
    theta : (n, p) array
    log_densities : (n,) array
        Of the posterior, up to a constant; minus infinity where there is no equilibrium.
    smoothed : Smoothed
    unstable, failed : int
        Draws whose law was not stable, and draws without an equilibrium: their weight is zero.
    """

    theta: Floats
    log_densities: Floats
    smoothed: Smoothed
    unstable: int
    failed: int

    @cached_property
    def mean(self) -> Floats:
        """Weighted, shape (p,)."""
        return np.asarray(self.smoothed.weights @ self.theta)

    @cached_property
    def standard_deviations(self) -> Floats:
        """Weighted, shape (p,)."""
        return np.sqrt(self.smoothed.weights @ (self.theta - self.mean) ** 2)

    def doubts(self, laplace: Laplace) -> tuple[str, ...]:
        """Why Laplace's approximation is not to be believed; empty if it is."""
        found = []
        if not self.smoothed.k <= RELIABLE:
            found.append(f"Pareto k is {self.smoothed.k:.2f}, above {RELIABLE}")
        deviations = laplace.standard_deviations
        # what as few draws say of a mean is itself uncertain by this many standard deviations
        error = 2.0 / np.sqrt(self.smoothed.effective)
        shift = np.abs(self.mean - laplace.theta) / deviations
        ratio = self.standard_deviations / deviations
        for name, away, times in zip(laplace.parameters.names, shift, ratio, strict=True):
            if away > _SHIFT + error:
                found.append(f"the mean of {name} is {away:.1f} standard deviations away")
            if not 1.0 / (_RATIO * (1.0 + error)) <= times <= _RATIO * (1.0 + error):
                found.append(f"the standard deviation of {name} is {times:.2f} times as large")
        return tuple(found)


def importance_sampling(
    target: Target,
    proposal: Proposal,
    count: int,
    rng: np.random.Generator,
    on_draw: Callable[[int], None] | None = None,
) -> Importance:
    """Weigh `count` draws of a proposal by a posterior; `on_draw` is called with the number of each."""
    theta = proposal.draw(rng, count)
    unstable, failed = target.unstable, target.failed
    logs = np.empty(count)
    for number, point in enumerate(theta):
        logs[number] = target.log_density(point)
        if on_draw is not None:
            on_draw(number + 1)
    smoothed = pareto_smoothed(logs - proposal.log_density(theta))
    return Importance(theta, logs, smoothed, target.unstable - unstable, target.failed - failed)
