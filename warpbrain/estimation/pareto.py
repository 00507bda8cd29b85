"""Can a few weights of importance be trusted? The shape of their tail says it.

The largest weights follow a generalised Pareto distribution; its shape k is how heavy the tail is. Up to 0.7 weighted
means converge, beyond it a few samples carry everything (Vehtari, Simpson, Gelman, Yao and Gabry 2024, J. Mach. Learn.
Res. 25, 72). The shape is found by Zhang and Stephens' quasi-Bayesian estimate (2009, Technometrics 51, 316).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats

#: Beyond this k weighted means do not converge.
RELIABLE = 0.7
#: Fewer weights in the tail than this tell nothing of its shape.
_FEWEST = 5


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Weights whose largest were replaced by the quantiles of the Pareto distribution that fits them.

    Attributes
    ----------
    weights : (n,) array
        Their sum is 1.
    k : float
        Shape of the tail; infinite if it cannot be told.
    """

    weights: Floats
    k: float

    @property
    def effective(self) -> float:
        """Number of equal weights that would tell as much."""
        return float(1.0 / np.sum(self.weights**2))


def pareto_smoothed(log_weights: Floats) -> Smoothed:
    """Smooth weights (n,), given as logarithms up to a constant; minus infinity for what is impossible.

    Examples
    --------
    >>> import numpy as np
    >>> pareto_smoothed(np.zeros(100)).effective
    100.0
    """
    largest = float(log_weights.max())
    if not np.isfinite(largest):
        return Smoothed(np.full(len(log_weights), 1.0 / len(log_weights)), np.inf)
    weights = np.exp(log_weights - largest)
    count = len(weights)
    tail = int(np.ceil(min(0.2 * count, 3.0 * np.sqrt(count))))
    order = np.argsort(weights)
    cut = weights[order[-tail - 1]] if tail < count else 0.0
    members = order[-tail:]
    above = weights[members] - cut
    if tail < _FEWEST:
        return Smoothed(weights / weights.sum(), np.inf)
    if above[-1] <= 1e-12:
        # all alike
        return Smoothed(weights / weights.sum(), 0.0)
    k, sigma = generalised_pareto(np.maximum(above, 1e-300))
    quantiles = (np.arange(tail) + 0.5) / tail
    spread = -np.log1p(-quantiles) if abs(k) < 1e-12 else np.expm1(-k * np.log1p(-quantiles)) / k
    smooth = weights.copy()
    # no weight beyond the largest that was seen
    smooth[members] = np.minimum(cut + sigma * spread, 1.0)
    return Smoothed(smooth / smooth.sum(), k)


def generalised_pareto(x: Floats) -> tuple[float, float]:
    """Shape and scale of the generalised Pareto distribution of exceedances `x` (n,), increasing and positive.

    Its distribution function is `1 - (1 + k x / sigma)^(-1/k)`. The shape is drawn a little towards 1/2, as Vehtari
    and others do with few exceedances.
    """
    from scipy.special import softmax

    n = len(x)
    points = 30 + int(np.sqrt(n))
    first_quartile = x[int(n / 4.0 + 0.5) - 1]
    theta = 1.0 / x[-1] + (1.0 - np.sqrt(points / (np.arange(1, points + 1) - 0.5))) / (3.0 * first_quartile)
    shapes = np.log1p(-theta[:, None] * x).mean(axis=1)
    log_likelihood = n * (np.log(-theta / shapes) - shapes - 1.0)
    best = float(np.sum(theta * softmax(log_likelihood)))
    k = float(np.log1p(-best * x).mean())
    sigma = -k / best
    return (n * k + 5.0) / (n + 10.0), sigma
