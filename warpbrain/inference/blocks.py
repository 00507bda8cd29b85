"""Columns of all places of all causes in coordinates in which rows without a cause are `N(0, I)`, and their products.

The log of a Bayes factor of columns `Z` with means `m` and prior deviations `s` is

    ln p(r | cause) - ln p(r | none) = |r|^2/2 - |r - m|^2/2 + b^T (M + D^-1)^-1 b / 2 - ln |I + D M| / 2
    b = Z^T (r - m),   M = Z^T Z,   D = diag(s^2)

Of pairs of blocks the first is eliminated by a Schur complement, once for all second ones.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.inference.causes import Cause
from warpbrain.inference.gaussian import GaussianModel


@dataclass(frozen=True, eq=False)
class ActingColumns:
    """Columns of causes that act together with each block: numbers (k,), prior deviations (k,), mean (n,)."""

    numbers: Ints
    deviations: Floats
    mean: Floats


class Blocks:
    """Blocks of columns, one a place, those of a cause one after the other, wide causes first.

    `model`: of the rows without a cause. `residual` (n,). `causes`: all with equally many sizes. `cause`, `place` (p,):
    which cause and which of its places each block is.
    """

    def __init__(self, model: GaussianModel, residual: Floats, causes: Sequence[Cause]) -> None:
        self._set_standardised(model.standardised(self._stacked(residual, causes)))

    @classmethod
    def at_scales(
        cls, model: GaussianModel, scales: Sequence[float], residual: Floats, causes: Sequence[Cause]
    ) -> Iterator[Blocks]:
        """Blocks with each of some factors on the noise."""
        unscaled: Blocks = object.__new__(cls)
        rows = unscaled._stacked(residual, causes)
        for standardised in model.standardised_at(scales, rows):
            blocks = copy.copy(unscaled)
            blocks._set_standardised(standardised)
            yield blocks

    def _set_standardised(self, rows: Floats) -> None:
        """Set standardised rows (n, 1 + p + q): residual, means and columns."""
        first = 1 + len(self.cause)
        self._r, self._m, self._Z = rows[:, 0], rows[:, 1:first], rows[:, first:]

    def _stacked(self, residual: Floats, causes: Sequence[Cause]) -> Floats:
        """Rows (n, 1 + p + q) of the residual, means and columns, not yet standardised; sets the order of blocks."""
        widths = [max(place.columns.shape[1] for place in cause.places) for cause in causes]
        order = np.argsort([-width for width in widths], kind="stable").tolist()
        self.cause = np.concatenate([np.full(len(causes[c].places), c) for c in order]).astype(np.int64)
        self.place = np.concatenate([np.arange(len(causes[c].places)) for c in order]).astype(np.int64)
        self._width = np.array(widths, dtype=np.int64)[self.cause]
        self._first = np.concatenate([[0], np.cumsum(self._width)])
        self._sizes = np.array([cause.sizes for cause in causes])[self.cause]
        self.log_weights = np.concatenate([causes[c].log_weights for c in order])
        first = 1 + len(self.cause)
        rows = np.zeros((len(residual), first + self._first[-1]))
        rows[:, 0] = residual
        for block, (c, p) in enumerate(zip(self.cause.tolist(), self.place.tolist(), strict=True)):
            place = causes[c].places[p]
            at = first + self._first[block]
            rows[:, at : at + place.columns.shape[1]] = place.columns
            if place.mean is not None:
                rows[:, 1 + block] = place.mean
        return rows

    def __len__(self) -> int:
        return len(self.cause)

    @cached_property
    def cause_edges(self) -> Ints:
        """Numbers (c + 1,) of the first block of each cause in order, and at last how many blocks there are."""
        return np.flatnonzero(np.diff(self.cause, prepend=-1, append=-1))

    @cached_property
    def _gram(self) -> Floats:
        """`Z^T Z` of all blocks: of few places, since each pair of these is weighed with every size."""
        return self._Z.T @ self._Z

    def subset(self, chosen: Ints) -> Blocks:
        """Some of the blocks by their numbers, in the same order."""
        other: Blocks = object.__new__(Blocks)
        keep = np.sort(chosen)
        other.cause, other.place, other.log_weights = self.cause[keep], self.place[keep], self.log_weights[keep]
        other._width, other._sizes = self._width[keep], self._sizes[keep]
        other._first = np.concatenate([[0], np.cumsum(other._width)])
        columns = np.concatenate([np.arange(self._first[k], self._first[k + 1]) for k in keep.tolist()])
        other._r, other._Z, other._m = self._r, self._Z[:, columns], self._m[:, keep]
        return other

    def acting(self, members: Sequence[tuple[int, int]]) -> ActingColumns:
        """Blocks by number, with the numbers of their sizes, as columns that act together with others."""
        columns = [np.arange(self._first[k], self._first[k + 1]) for k, _ in members]
        deviations = [np.full(self._width[k], self._sizes[k, size]) for k, size in members]
        mean = self._m[:, [k for k, _ in members]].sum(axis=1)
        return ActingColumns(np.concatenate(columns), np.concatenate(deviations), mean)

    def log_factors(self, acting: ActingColumns | None = None, start: int = 0) -> Floats:
        """Log Bayes factors (p - start, s) of blocks from `start` on, with every size.

        `acting`: columns that act together with each block: factors are then of both together, against neither.
        `start`: number of the first block.
        """
        logs = np.empty((len(self) - start, self._sizes.shape[1]))
        widths = self._width[start:]
        # causes of the same width are next to each other
        edges = np.flatnonzero(np.diff(widths)) + 1
        for low, high in zip([0, *edges.tolist()], [*edges.tolist(), len(widths)], strict=True):
            logs[low:high] = self._log_factors_of_width(np.arange(start + low, start + high), acting)
        return logs

    def _log_factors_of_width(self, blocks: Ints, acting: ActingColumns | None) -> Floats:
        """Log Bayes factors (b, s) of blocks that are all as wide as each other."""
        count, width = len(blocks), int(self._width[blocks[0]])
        at = slice(self._first[blocks[0]], self._first[blocks[-1] + 1])
        Z, means, sizes = self._Z[:, at], self._m[:, blocks], self._sizes[blocks]
        of_block = Z.reshape(len(Z), count, width)
        if acting is None:
            M = np.einsum("nbi,nbj->bij", of_block, of_block, optimize=True)
        else:
            numbers = np.arange(at.start, at.stop).reshape(count, width)
            M = self._gram[numbers[:, :, None], numbers[:, None, :]]
        with_means = bool(means.any())
        r = self._r if acting is None else self._r - acting.mean
        residual = r[:, None] - means if with_means else r[:, None]
        b = (
            np.einsum("nbi,nb->bi", of_block, np.broadcast_to(residual, (len(Z), count)), optimize=True)
            if with_means
            else (residual[:, 0] @ Z).reshape(count, width)
        )
        log = 0.5 * (self._r @ self._r - np.sum(residual**2, axis=0)) * np.ones(count)
        if acting is not None:
            W = self._Z[:, acting.numbers]
            of_acting = self._gram[acting.numbers]
            A = np.linalg.inv(of_acting[:, acting.numbers] + np.diag(acting.deviations**-2.0))
            projection = W.T @ residual
            C = of_acting[:, at].reshape(len(A), count, width)
            AC = np.tensordot(A, C, 1)
            M = M - np.einsum("kbi,kbj->bij", C, AC)
            b = b - np.einsum("kbi,kb->bi", AC, np.broadcast_to(projection, (len(A), count)))
            log = log + 0.5 * np.einsum("kb,kl,lb->b", projection, A, projection) * np.ones(count)
            log = log + 0.5 * np.linalg.slogdet(A)[1] - np.log(acting.deviations).sum()
        values, vectors = np.linalg.eigh(M)
        projected = np.einsum("bij,bi->bj", vectors, b) ** 2
        ratio = sizes[:, :, None] ** 2
        explained = np.sum(ratio * projected[:, None] / (1.0 + ratio * np.maximum(values, 0.0)[:, None]), axis=2)
        volume = np.sum(np.log1p(ratio * np.maximum(values, 0.0)[:, None]), axis=2)
        return np.asarray(log[:, None] + 0.5 * (explained - volume))
