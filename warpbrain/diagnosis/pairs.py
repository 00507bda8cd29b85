"""A force that nobody has a name for, in two places: they draw each other, or push each other away.

A smooth force is spread over all of the body, and what acts in a few places is poorly one. What acts within a body, or
from one part of its surface to another, has no net force and no moment; two opposite forces along the line between
their places are the simplest that has neither, and every other is a sum of such pairs. So beside smooth forces stands
one pair: any two of some places on the surface, Gaussian patches, with any of some sizes.

What a pair of places i and j does to the sensors is `e_ij . (B_i - B_j)`, with `B` what a force there does and `e` the
unit vector between them. So all that the evidence asks of thousands of pairs are moments of a few hundred columns:
`B^T S^-1 B` and `B^T S^-1 r`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import KAPPAS, Explanation, kappa_log_prior
from warpbrain.mesh import node_areas
from warpbrain.threads import in_threads
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.sensors import spread_points

Floats = NDArray[np.float64]

#: Places on the surface that can move, and the length of a patch in spacings of the sites of a scan.
PLACES, LENGTH = 120, 0.5
#: Sizes of what a pair changes, root mean square over the displacements, in standard deviations of the noise.
SIZES = (0.5, 1.5, 4.0)
#: Part of the middle pair's visibility below which a pair is not made any larger, and residuals at once.
_UNSEEN, _AT_ONCE = 0.01, 16


@dataclass(frozen=True, eq=False)
class Pairs:
    """All pairs of some places.

    Attributes
    ----------
    sites : (s, 3) array
        The places [m].
    columns : (n, 3 s) array
        What a force of 1 N in each direction does to the sensors, place by place.
    scales : (p,) array
        Force [N] of each pair, in the order of `numpy.triu_indices`, that displaces the sensors by 1 m.
    """

    sites: Floats
    columns: Floats
    scales: Floats

    def seen(self, through: Callable[[Floats], Floats]) -> Pairs:
        """The same with other rows: whitened ones."""
        return replace(self, columns=through(self.columns))

    @cached_property
    def ends(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Places (p,) and (p,) of each pair."""
        first, second = np.triu_indices(len(self.sites), 1)
        return first, second

    @cached_property
    def along(self) -> Floats:
        """Unit vectors (p, 3) from the first place of each pair to the second."""
        first, second = self.ends
        apart = self.sites[second] - self.sites[first]
        return np.asarray(apart / np.linalg.norm(apart, axis=1)[:, None])

    def column(self, number: int) -> Floats:
        """What a pair (n, 1) does, of 1 m."""
        first, second = (int(end[number]) for end in self.ends)
        each = self.columns.reshape(len(self.columns), -1, 3)
        return np.asarray(self.scales[number] * (each[:, first] - each[:, second]) @ self.along[number])[:, None]

    def quadratic(self, moments: Floats) -> Floats:
        """`g^T M g` (p,) of the pairs' columns from that of the places (3 s, 3 s)."""
        count = len(self.sites)
        blocks = moments.reshape(count, 3, count, 3).transpose(0, 2, 1, 3)
        first, second = self.ends
        between = blocks[first, second]
        own = np.einsum("ssab->sab", blocks)
        # the moments are symmetric, and a quadratic form asks no more of a block than it has both ways round
        whole = own[first] + own[second] - 2.0 * between
        return np.asarray(self.scales**2 * np.einsum("pa,pab,pb->p", self.along, whole, self.along, optimize=True))

    def linear(self, moments: Floats) -> Floats:
        """`g^T m` (p, b) of the pairs' columns from that of the places (3 s, b)."""
        return np.asarray(self._of_places @ moments)

    @cached_property
    def _of_places(self) -> Any:
        """From forces at the places to those of the pairs, SciPy CSR (p, 3 s): six numbers a row."""
        from scipy.sparse import csr_matrix

        places = 3 * np.column_stack(self.ends)[:, :, None] + np.arange(3)
        scaled = self.scales[:, None] * self.along
        first = np.arange(0, places.size + 1, 6)
        values = np.column_stack([scaled, -scaled]).ravel()
        return csr_matrix((values, places.ravel(), first), (len(scaled), 3 * len(self.sites)))


def pairs_at(at: Linearisation, spacing: float) -> Pairs:
    """Pairs of places on what of the surface can move; of a body that is held all around, of places in it.

    Parameters
    ----------
    at : Linearisation
    spacing : float
        Of the sites of a scan [m].
    """
    from scipy.spatial.distance import cdist

    model = at.system.model
    mesh = model.mesh
    shares, movable = node_areas(mesh.points, mesh.boundary), ~model.constrained.reshape(-1, 3).all(axis=1)
    if not (movable & (shares > 0.0)).any():
        shares = mesh.node_volumes
    free = np.flatnonzero(movable & (shares > 0.0))
    sites = mesh.points[free[spread_points(mesh.points[free], 0.0, PLACES)]]
    apart = cdist(mesh.points, sites)
    weights = shares[:, None] * np.exp(-0.5 * (apart / (LENGTH * spacing)) ** 2)
    weights /= weights.sum(axis=0)
    columns = at.answers_of_patches(weights).reshape(len(at.sensors), -1)
    rows = at.sensors.is_displacement
    rows = rows if rows.any() else np.ones(len(rows), dtype=bool)
    plain = Pairs(sites, columns, np.ones(len(sites) * (len(sites) - 1) // 2))
    lengths = np.sqrt(np.maximum(plain.quadratic(columns[rows].T @ columns[rows]) / rows.sum(), 0.0))
    # two places that no sensor sees are not pulled until one does
    return replace(plain, scales=1.0 / np.maximum(lengths, _UNSEEN * np.median(lengths)))


class PairEvidence:
    """Evidence of any one pair beside what is explained already.

    Parameters
    ----------
    explanation : Explanation
        Noise and nuisances.
    pairs : Pairs
        Not whitened.
    noise : float
        That sizes are relative to [m].
    """

    def __init__(self, explanation: Explanation, pairs: Pairs, noise: float) -> None:
        self.explanation = explanation
        self.pairs = pairs
        self.noise = noise
        self._white = pairs.seen(explanation.whitened)
        self._moments: dict[float, tuple[Floats, Floats]] = {}

    def prepare(self, kappas: Floats) -> None:
        """Make what has no residual in it, for factors on the noise (k,): threads may ask for evidence then."""
        missing = [kappa for kappa in kappas.tolist() if kappa not in self._moments]
        self._moments.update(zip(missing, in_threads(self._made, missing), strict=True))

    def log_marginal(self, residuals: Floats, kappas: Floats = KAPPAS) -> Floats:
        """Log density (b,) of whitened residuals (n, b), averaged over pairs, sizes and factors on the noise."""
        from scipy.special import logsumexp

        self.prepare(kappas)
        logs = self.explanation.log_none(residuals, kappas) + kappa_log_prior(kappas)[:, None]
        for number, kappa in enumerate(kappas.tolist()):
            for low in range(0, residuals.shape[1], _AT_ONCE):
                some = slice(low, low + _AT_ONCE)
                logs[number, some] += self._log_mean_factor(residuals[:, some], kappa)
        return np.asarray(logsumexp(logs, axis=0))

    def best(self, residual: Floats) -> Floats:
        """What the most probable pair (n, 1) does, of one standard deviation; `residual` (n,) is whitened."""
        kappa = self.explanation.best_kappa(residual)
        self.prepare(np.array([kappa]))
        exponents, weights = self._factors(residual[:, None], kappa)
        factors = exponents[:, :, 0] + np.log(weights)
        size, number = np.unravel_index(int(np.argmax(factors)), factors.shape)
        return SIZES[int(size)] * self.noise * self.pairs.column(int(number))

    def drawn(self, rng: np.random.Generator) -> Floats:
        """What any pair (n, 1) does, of one standard deviation of any size."""
        return rng.choice(SIZES) * self.noise * self.pairs.column(int(rng.integers(len(self.pairs.scales))))

    def _log_mean_factor(self, residuals: Floats, kappa: float) -> Floats:
        """Logarithm of the Bayes factor (b,), averaged over pairs and sizes: in place, since there are millions."""
        exponents, weights = self._factors(residuals, kappa)
        largest = exponents.max(axis=(0, 1))
        exponents -= largest
        np.exp(exponents, out=exponents)
        return np.asarray(largest + np.log(np.einsum("zp,zpb->b", weights, exponents, optimize=True) / weights.size))

    def _factors(self, residuals: Floats, kappa: float) -> tuple[Floats, Floats]:
        """Bayes factors of pairs of each size: their exponents (sizes, p, b), and factors (sizes, p) on them."""
        weighted, squares = self._moments[kappa]
        products = self._white.linear(weighted.T @ residuals)
        products *= products
        variances = (np.array(SIZES) * self.noise)[:, None] ** 2
        more = 1.0 + variances * squares
        return (0.5 * variances / more)[:, :, None] * products, 1.0 / np.sqrt(more)

    def _made(self, kappa: float) -> tuple[Floats, Floats]:
        """`S^-1` of the places' columns, and `g^T S^-1 g` (p,) of the pairs."""
        columns = self._white.columns
        weighted = self.explanation.precision_times(columns, kappa)
        return weighted, self._white.quadratic(columns.T @ weighted)
