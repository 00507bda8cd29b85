"""Evidence of many effects at once, for many residuals.

Of an effect with the mean `h` and columns `G`, all whitened, the Bayes factor against none is

    exp(h^T S^-1 r - h^T S^-1 h / 2 + b^T M^-1 b / 2) / sqrt(det M),    M = I + G^T S^-1 G,    b = G^T S^-1 (r - h).

What has no residual in it is made once for each factor on the noise, and asked again for thousands of residuals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import KAPPAS, Explanation, Stack, kappa_log_prior
from warpbrain.threads import in_threads

Floats = NDArray[np.float64]

#: Numbers in a stack from which threads gain more than they cost.
_LARGE = 50_000


@dataclass(frozen=True, eq=False)
class _Family:
    """Effects (v) of one width: which they are, and where their columns are among those in the order of families."""

    members: NDArray[np.int64]
    width: int
    columns: slice

    def each(self, rows: Floats) -> Floats:
        """What belongs to the columns of each effect (v, w, ...), of what belongs to all columns (K, ...)."""
        return rows[self.columns].reshape(len(self.members), self.width, *rows.shape[1:])


@dataclass(frozen=True, eq=False)
class _Known:
    """What is known of a family at one factor on the noise.

    Attributes
    ----------
    mean : (v,) array
        `h^T S^-1 h`.
    crossed : (v, w - 1) array
        `G^T S^-1 h`.
    root : (v, w - 1, w - 1) array
        `R` with `R^T R = M^-1`.
    log_root : (v,) array
        Logarithm of its determinant.
    """

    mean: Floats
    crossed: Floats
    root: Floats
    log_root: Floats


class StackEvidence:
    """Evidence of each effect of a stack beside what is explained already.

    Parameters
    ----------
    explanation : Explanation
        Noise and nuisances.
    stack : Stack
        Whitened by that noise.
    """

    def __init__(self, explanation: Explanation, stack: Stack) -> None:
        self.explanation, self.stack = explanation, stack
        widths = np.diff(stack.first)
        order, self._families, end = [np.zeros(0, dtype=np.int64)], [], 0
        for width in np.unique(widths).tolist():
            members = np.flatnonzero(widths == width)
            order.append((stack.first[members][:, None] + np.arange(width)).ravel())
            self._families.append(_Family(members, width, slice(end, end + width * len(members))))
            end += width * len(members)
        self._order = np.concatenate(order)
        self._VG = np.asarray(explanation.seen_by_nuisances(stack.columns).T[self._order])
        self._grams: list[Floats] | None = None
        self._at: dict[float, list[_Known]] = {}

    def prepare(self, kappas: Floats) -> None:
        """Make what has no residual in it, for factors on the noise (k,): threads may ask for evidence then."""
        if self._grams is None:
            self._grams = [self._gram(family) for family in self._families]
        missing = [kappa for kappa in kappas.tolist() if kappa not in self._at]
        made = in_threads(self._known, missing) if self._VG.size > _LARGE else map(self._known, missing)
        self._at.update(zip(missing, made, strict=True))

    def log_factors(self, residuals: Floats, kappas: Floats = KAPPAS) -> Floats:
        """Log Bayes factor of each effect against none, for whitened residuals (n, b): (kappas, v, b)."""
        self.prepare(kappas)
        Vr = self.explanation.seen_by_nuisances(residuals)
        Gr = (self.stack.columns.T @ residuals)[self._order]
        found = np.empty((len(kappas), len(self.stack), residuals.shape[1]))
        for k, kappa in enumerate(kappas.tolist()):
            GSr = (Gr - self._VG @ (Vr / (kappa**2 + self.explanation.sizes)[:, None])) / kappa**2
            for family, own in zip(self._families, self._at[kappa], strict=True):
                products = family.each(GSr)
                log = products[:, 0] + (own.log_root - 0.5 * own.mean)[:, None]
                if family.width > 1:
                    white = own.root @ (products[:, 1:] - own.crossed[:, :, None])
                    log += 0.5 * np.einsum("vib,vib->vb", white, white)
                found[k, family.members] = log
        return found

    def log_places(self, residuals: Floats, kappas: Floats = KAPPAS) -> Floats:
        """Log density (v, b) of whitened residuals (n, b) with each effect, averaged over the factor on the noise."""
        from scipy.special import logsumexp

        base = self.explanation.log_none(residuals, kappas)[:, None, :]
        logs = base + self.log_factors(residuals, kappas) + kappa_log_prior(kappas)[:, None, None]
        return np.asarray(logsumexp(logs, axis=0))

    def coefficients(self, residual: Floats, kappa: float, number: int) -> tuple[Floats, Floats]:
        """Mean (k,) and covariance (k, k) of the `z` of an effect after a residual (n,), whitened."""
        own = self.stack.of(number)
        weighted = self.explanation.precision_times(own, kappa)
        covariance = np.asarray(np.linalg.inv(np.eye(own.shape[1] - 1) + own[:, 1:].T @ weighted[:, 1:]))
        return covariance @ (weighted[:, 1:].T @ (residual - own[:, 0])), covariance

    def _gram(self, family: _Family) -> Floats:
        """`G^T G` (v, w, w) of the columns of a family, those of means among them."""
        own = self.stack.columns[:, self._order[family.columns]].reshape(-1, len(family.members), family.width)
        return np.asarray(np.einsum("nvi,nvj->vij", own, own, optimize=True))

    def _known(self, kappa: float) -> list[_Known]:
        """What is known of each family."""
        k2, found = kappa**2, []
        assert self._grams is not None
        for family, gram in zip(self._families, self._grams, strict=True):
            own = family.each(self._VG)
            GSG = (gram - (own / (k2 + self.explanation.sizes)) @ own.transpose(0, 2, 1)) / k2
            L = np.linalg.cholesky(np.eye(family.width - 1) + GSG[:, 1:, 1:])
            log_root = -np.log(np.diagonal(L, axis1=1, axis2=2)).sum(axis=1)
            found.append(_Known(GSG[:, 0, 0], GSG[:, 1:, 0], np.linalg.inv(L), log_root))
        return found
