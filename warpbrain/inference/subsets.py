"""Posterior over sets of causes in closed form: none, every cause, every pair, and triples that extend good pairs.

The evidence of a set is the sum over the places and sizes of its causes and over the scale of the noise. In coordinates
in which rows without a cause are `N(0, I)` the log of a Bayes factor of columns `Z` with means `m` and prior deviations
`s` is

    ln p(r | cause) - ln p(r | none) = |r|^2/2 - |r - m|^2/2 + b^T (M + D^-1)^-1 b / 2 - ln |I + D M| / 2
    b = Z^T (r - m),   M = Z^T Z,   D = diag(s^2)

Of pairs of blocks of columns the first is eliminated by a Schur complement, once for all second ones.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.inference.causes import Cause, Configuration, Hypothesis, Member
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.threads import in_threads


@dataclass(frozen=True, eq=False)
class ActingColumns:
    """Columns of causes that act together with each block, once with each of a combinations of their sizes.

    `numbers` (k,), and the sum `mean` (n,) of their means.
    `inverse` (a, k, k): `(Z^T Z + D^-1)^-1`, by which they are eliminated; `log_volume` (a,): `-ln |I + D Z^T Z| / 2`.
    """

    numbers: Ints
    mean: Floats
    inverse: Floats
    log_volume: Floats


@dataclass(frozen=True, eq=False)
class _OfWidth:
    """Products of the white rows of blocks `low` to `high`, all as wide as each other: the same at all scales."""

    low: int
    high: int
    gram: Floats  # (b, k, k), of the columns of each block
    residual: Floats  # (b, k), of these with the residual less the mean of the block
    square: Floats  # (b,) or (1,), of that residual with itself


class _Ordered:
    """Blocks of columns, one a place, those of a cause one after the other, wide causes first.

    `cause`, `place` (p,): which cause and which of its places each block is. `log_weights` (p, s).
    """

    cause: Ints
    place: Ints
    log_weights: Floats
    _width: Ints  # (p,)
    _first: Ints  # (p + 1,), of the columns of each
    _sizes: Floats  # (p, s)
    _mean: Ints  # (p,), number of the mean of each from 1 on; 0 where that is zero

    def __len__(self) -> int:
        return len(self.cause)

    @cached_property
    def cause_edges(self) -> Ints:
        """Numbers (c + 1,) of the first block of each cause in order, and at last how many blocks there are."""
        return np.flatnonzero(np.diff(self.cause, prepend=-1, append=-1))

    def _runs(self, start: int) -> list[tuple[int, int]]:
        """First and one past the last of each run of blocks of the same width, from `start` on."""
        edges = (np.flatnonzero(np.diff(self._width[start:])) + 1 + start).tolist()
        return list(itertools.pairwise([start, *edges, len(self)]))


class Blocks(_Ordered):
    """Every place of all causes, each by itself.

    `model`: of the rows without a cause. `residual` (n,). `causes`: all with equally many sizes.
    """

    def __init__(self, model: GaussianModel, residual: Floats, causes: Sequence[Cause]) -> None:
        widths = [np.array([place.columns.shape[1] for place in cause.places]) for cause in causes]
        order = np.argsort([-each.max() for each in widths], kind="stable").tolist()
        self.cause = np.concatenate([np.full(len(causes[c].places), c) for c in order]).astype(np.int64)
        self.place = np.concatenate([np.arange(len(causes[c].places)) for c in order]).astype(np.int64)
        self.log_weights = np.concatenate([causes[c].log_weights for c in order])
        self._width = np.concatenate([widths[c] for c in order]).astype(np.int64)
        self._first = np.concatenate([[0], np.cumsum(self._width)])
        self._sizes = np.array([cause.sizes for cause in causes])[self.cause]
        places = [place for c in order for place in causes[c].places]
        means = [place.mean for place in places if place.mean is not None]
        given = np.array([place.mean is not None for place in places])
        self._mean = np.where(given, np.cumsum(given), 0)
        # the residual, means that are given, and columns
        self._white = model.white(np.column_stack([residual, *means, *(place.columns for place in places)]))
        self._scale = model.scale
        self._by_width = [self._products(low, high) for low, high in self._runs(0)]

    def at(self, scale: float) -> Blocks:
        """The same with another factor on the noise."""
        other = copy.copy(self)
        other._scale = scale
        return other

    def _products(self, low: int, high: int) -> _OfWidth:
        at, means = self._columns(low, high), self._mean[low:high]
        of_block = self._white.rows[at].reshape(high - low, -1, self._white.rows.shape[1])
        residual = self._residuals(self._white.rows, means)
        b = (of_block @ residual[:, :, None])[:, :, 0]
        return _OfWidth(low, high, of_block @ of_block.transpose(0, 2, 1), b, np.sum(residual**2, axis=1))

    def _columns(self, low: int, high: int) -> slice:
        """Numbers of the rows of what is kept of all that are the columns of some blocks."""
        before = len(self._white.rows) - self._first[-1]
        return slice(int(before + self._first[low]), int(before + self._first[high]))

    @staticmethod
    def _residuals(rows: Floats, means: Ints) -> Floats:
        """The first of rows less those of means (b, ...); one for all blocks without means."""
        return rows[0] - np.where((means > 0)[:, None], rows[means], 0.0) if means.any() else rows[:1]

    def log_factors(self) -> Floats:
        """Log Bayes factors (p, s) of each block by itself, with every size."""
        white, weights = self._white, self._white.weights(self._scale)
        of_residual, logs = white.projected[0] ** 2 @ weights, []
        for run in self._by_width:
            at = white.projected[self._columns(run.low, run.high)].reshape(*run.residual.shape, len(weights))
            residual = self._residuals(white.projected, self._mean[run.low : run.high])
            weighted = at * weights
            M = run.gram - weighted @ at.transpose(0, 2, 1)
            b = run.residual - (weighted @ residual[:, :, None])[:, :, 0]
            change = white.rows[0] @ white.rows[0] - of_residual - run.square + residual**2 @ weights
            log = 0.5 * change * np.ones(run.high - run.low)
            of_scale = self._scale**2
            logs.append(_log_factors(M / of_scale, b / of_scale, log / of_scale, self._sizes[run.low : run.high]))
        return np.concatenate(logs)

    def subset(self, chosen: Ints) -> ActingBlocks:
        """Some of the blocks by their numbers, in the same order, which may act beside others."""
        return ActingBlocks(self, np.sort(chosen))


class ActingBlocks(_Ordered):
    """Few blocks, of which all products with each other are known.

    `blocks`: of which they are. `keep` (p,): their numbers, in order.
    """

    def __init__(self, blocks: Blocks, keep: Ints) -> None:
        self.cause, self.place, self.log_weights = blocks.cause[keep], blocks.place[keep], blocks.log_weights[keep]
        self._width, self._sizes, self._mean = blocks._width[keep], blocks._sizes[keep], blocks._mean[keep]
        self._first = np.concatenate([[0], np.cumsum(self._width)])
        before = len(blocks._white.rows) - blocks._first[-1]
        columns = [before + np.arange(blocks._first[k], blocks._first[k + 1]) for k in keep.tolist()]
        rows = blocks._white[np.concatenate([np.arange(before), *columns])].standardised(blocks._scale)
        self._r, self._Z = rows[0], rows[before:]
        # the first stands for those that are zero
        self._means = np.concatenate([np.zeros((1, rows.shape[1])), rows[1:before]])

    @cached_property
    def _gram(self) -> Floats:
        """`Z^T Z` of all blocks: each pair of them is weighed with every size."""
        return self._Z @ self._Z.T

    def acting(self, members: Sequence[int], sizes: Sequence[Sequence[int]]) -> ActingColumns:
        """Blocks by number as columns that act together with others, once with each row (a, m) of numbers of sizes."""
        columns = np.concatenate([np.arange(self._first[k], self._first[k + 1]) for k in members])
        deviations = np.repeat(self._sizes[members, sizes], self._width[members], axis=1)
        of_columns = self._gram[np.ix_(columns, columns)]
        inverse = np.linalg.inv(of_columns + np.eye(len(columns)) * deviations[:, None] ** -2.0)
        log_volume = 0.5 * np.linalg.slogdet(inverse)[1] - np.log(deviations).sum(axis=1)
        return ActingColumns(columns, self._means[self._mean[members]].sum(axis=0), inverse, log_volume)

    def log_factors_beside(self, acting: ActingColumns, start: int = 0) -> Floats:
        """Log Bayes factors (a, p - start, s) of blocks from `start` on and what acts together, against neither.

        With every size of a block, and each combination of sizes of what acts.
        """
        return np.concatenate([self._beside(acting, low, high) for low, high in self._runs(start)], axis=1)

    def _beside(self, acting: ActingColumns, low: int, high: int) -> Floats:
        """The same (a, b, s) of blocks `low` to `high`, that are all as wide as each other."""
        at, means = slice(int(self._first[low]), int(self._first[high])), self._mean[low:high]
        count, numbers = high - low, np.arange(at.start, at.stop).reshape(high - low, -1)
        width = numbers.shape[1]
        of_block, M = self._Z[at].reshape(count, width, -1), self._gram[numbers[:, :, None], numbers[:, None, :]]
        r = self._r - acting.mean
        # one for all blocks without means
        residual = r - self._means[means] if means.any() else r[None]
        b = (of_block @ residual[:, :, None])[:, :, 0]
        log = 0.5 * (self._r @ self._r - np.sum(residual**2, axis=1)) * np.ones(count)
        A, projection = acting.inverse, self._Z[acting.numbers] @ residual.T
        # (k, b w) and, eliminated, (a, k, b w)
        C = self._gram[acting.numbers, at]
        AC = A @ C
        of_pairs = AC.reshape(*AC.shape[:2], count, width).transpose(0, 2, 3, 1)
        M = M - of_pairs @ C.reshape(-1, count, width).transpose(1, 0, 2)
        b = b - np.sum(of_pairs * projection.T[:, None], axis=3)
        log = log + 0.5 * np.sum(projection * (A @ projection), axis=1) + acting.log_volume[:, None]
        return _log_factors(M, b, log, self._sizes[low:high])


def _log_factors(M: Floats, b: Floats, log: Floats, sizes: Floats) -> Floats:
    """Log Bayes factors (..., b, s) of blocks with `M` (..., b, k, k), `b` (..., b, k) and every size (b, s).

    `log` (..., b): of what does not depend on their sizes.
    """
    values, vectors = np.linalg.eigh(M)
    projected = (b[..., None, :] @ vectors) ** 2
    ratio = sizes[:, :, None] ** 2
    grown = ratio * np.maximum(values, 0.0)[..., None, :]
    explained = np.sum(ratio * projected / (1.0 + grown), axis=-1)
    return np.asarray(log[..., None] + 0.5 * (explained - np.sum(np.log1p(grown), axis=-1)))


@dataclass(frozen=True, eq=False)
class Search:
    """Which sets are summed over."""

    #: (k,): factors on the noise that are summed over, and the log probability of each.
    scales: Floats
    log_scale_prior: Floats
    places: int = 50  # best places of each cause of which pairs are made
    beam: int = 30  # best configurations of pairs to which a third cause is added at each scale; 0: no triples
    most: int = 3  # causes of a set at most
    #: Pairs and triples are left out at scales where every single cause is below this part of the greatest density.
    negligible: float = 1e-4
    #: Configurations of each single cause at other places than the best that are kept, beside the best of each label.
    elsewhere: int = 0


class _Sums:
    """Sums of densities by sets of causes, as logarithms, and the best configuration of each."""

    def __init__(self) -> None:
        self.logs: dict[frozenset[int], float] = {}
        self.best: dict[frozenset[int], Configuration] = {}

    def add(self, causes: frozenset[int], log: float, best: Configuration) -> None:
        self.logs[causes] = float(np.logaddexp(self.logs.get(causes, -np.inf), log))
        if causes not in self.best or best.log_density > self.best[causes].log_density:
            self.best[causes] = best

    def add_blocks(
        self, blocks: _Ordered, start: int, logs: Floats, members: tuple[Member, ...], scale: float
    ) -> list[Configuration]:
        """Add log densities (p, s) of blocks from `start` on together with members; returns the best of each cause."""
        acting = {member.cause for member in members}
        edges = blocks.cause_edges[blocks.cause_edges >= start].tolist()
        best = []
        for low, high in itertools.pairwise(edges):
            cause = int(blocks.cause[low])
            if cause in acting:
                continue
            of_cause = logs[low - start : high - start]
            row = int(np.argmax(of_cause.max(axis=1)))
            best.append(_configuration(blocks, low + row, of_cause[row], members, scale))
            of_places = np.logaddexp.reduce(of_cause, axis=1)
            self.add(frozenset(acting | {cause}), float(np.logaddexp.reduce(of_places)), best[-1])
        return best


def _configuration(
    blocks: _Ordered, number: int, logs: Floats, members: tuple[Member, ...], scale: float
) -> Configuration:
    """A block with its best size, of which there are log densities (s,), after other members."""
    size = int(np.argmax(logs))
    last = Member(int(blocks.cause[number]), int(blocks.place[number]), size)
    return Configuration((*members, last), scale, float(logs[size]))


class _Places:
    """Sums of densities of each single cause by the numbers of its places, as logarithms, and where it is likely.

    `most`: of each cause, so many places are kept at each scale, and one of each label.
    """

    def __init__(self, causes: Sequence[Cause], most: int) -> None:
        self._most = most
        self._labels = [np.array([place.label for place in cause.places]) for cause in causes]
        self._logs: list[dict[int, float]] = [{} for _ in causes]
        self._best: list[dict[int, Configuration]] = [{} for _ in causes]

    def add(self, blocks: Blocks, logs: Floats, scale: float) -> None:
        """Add log densities (p, s) of all blocks."""
        for low, high in itertools.pairwise(blocks.cause_edges.tolist()):
            cause, places, of_cause = int(blocks.cause[low]), blocks.place[low:high], logs[low:high]
            known, best = self._logs[cause], self._best[cause]
            for place, log in zip(places.tolist(), np.logaddexp.reduce(of_cause, axis=1).tolist(), strict=True):
                known[place] = float(np.logaddexp(known.get(place, -np.inf), log))
            order = np.argsort(-of_cause.max(axis=1))
            of_each_label = order[np.unique(self._labels[cause][places][order], return_index=True)[1]]
            for number in {*order[: self._most].tolist(), *of_each_label.tolist()}:
                configuration = _configuration(blocks, low + number, of_cause[number], (), scale)
                place = configuration.members[0].place
                if place not in best or configuration.log_density > best[place].log_density:
                    best[place] = configuration

    def ranked(self, best: Configuration, log_evidence: float) -> list[Configuration]:
        """The best configuration of a single cause of such evidence, the best at other places and at one of each label.

        Each with the share of its place in the evidence.
        """
        [member] = best.members
        of_places, place_labels = self._logs[member.cause], self._labels[member.cause]
        chosen, labels = [best], {place_labels[member.place]}
        for place, other in sorted(self._best[member.cause].items(), key=lambda known: -known[1].log_density):
            if place != member.place and (len(chosen) < self._most or place_labels[place] not in labels):
                chosen.append(other)
                labels.add(place_labels[place])
        shares = [of_places[configuration.members[0].place] - log_evidence for configuration in chosen]
        return [replace(each, log_share=min(share, 0.0)) for each, share in zip(chosen, shares, strict=True)]


def posterior(
    model: GaussianModel, residual: Floats, causes: Sequence[Cause], search: Search
) -> tuple[Hypothesis, ...]:
    """Evidence of sets of at most three causes, the most probable first.

    `model`: of rows (n,) on which no cause acts. `residual` (n,).
    """
    sums, alone = _Sums(), _Places(causes, 1 + search.elsewhere)
    unscaled = Blocks(model, residual, causes) if causes else None

    def weighed_at(scale: float) -> tuple[float, Blocks | None, Floats]:
        """Log density without any cause, blocks and their log Bayes factors."""
        none = float(model.with_scale(scale).log_density(residual))
        blocks = None if unscaled is None else unscaled.at(scale)
        return none, blocks, np.zeros((0, 0)) if blocks is None else blocks.log_factors()

    by_scale: list[tuple[float, float, Blocks, Floats]] = []
    scales = search.scales.tolist()
    of_scales = zip(scales, search.log_scale_prior.tolist(), in_threads(weighed_at, scales), strict=True)
    for scale, log_prior, (density, blocks, factors) in of_scales:
        none = density + log_prior
        sums.add(frozenset(), none, Configuration((), scale, none))
        if blocks is not None:
            logs = factors + blocks.log_weights + none
            sums.add_blocks(blocks, 0, logs, (), scale)
            alone.add(blocks, logs, scale)
            by_scale.append((scale, none, blocks, logs))
    greatest = max((float(logs.max()) for *_, logs in by_scale), default=0.0)
    most = min(len(causes), search.most)
    for scale, none, blocks, logs in by_scale:
        if most > 1 and logs.max() >= greatest + np.log(search.negligible):
            kept = blocks.subset(_best_places(blocks, logs, search.places))
            pairs = _add_pairs(sums, kept, none, scale)
            if most > 2:
                pairs.sort(key=lambda pair: -pair.log_density)
                _add_triples(sums, kept, none, pairs[: search.beam])
    hypotheses = []
    for members, log in sums.logs.items():
        best, elsewhere = sums.best[members], list[Configuration]()
        if len(members) == 1:
            best, *elsewhere = alone.ranked(best, log)
        hypotheses.append(
            Hypothesis(
                tuple(causes[c].name for c in sorted(members)),
                tuple(causes[c].kind for c in sorted(members)),
                log,
                sum(causes[c].log_prior for c in members),
                best,
                tuple(elsewhere),
            )
        )
    return tuple(sorted(hypotheses, key=lambda hypothesis: -(hypothesis.log_evidence + hypothesis.log_prior)))


def likely_places(model: GaussianModel, residual: Floats, causes: Sequence[Cause], most: int) -> dict[str, Ints]:
    """Numbers of the most probable places of each cause by its name, if it acts alone, at the scale of a model.

    `model`: of rows (n,) on which no cause acts.
    `residual` (n,).
    `most`: places of each cause at most.
    """
    blocks = Blocks(model, residual, causes)
    chosen = _best_places(blocks, blocks.log_factors() + blocks.log_weights, most)
    return {cause.name: blocks.place[chosen[blocks.cause[chosen] == c]] for c, cause in enumerate(causes)}


def _best_places(blocks: Blocks, logs: Floats, most: int) -> Ints:
    """Numbers of the best blocks of each cause."""
    of_block = np.logaddexp.reduce(logs, axis=1)
    chosen = []
    for cause in np.unique(blocks.cause).tolist():
        numbers = np.flatnonzero(blocks.cause == cause)
        chosen.append(numbers[np.argsort(-of_block[numbers])[:most]])
    return np.concatenate(chosen)


def _add_pairs(sums: _Sums, blocks: ActingBlocks, none: float, scale: float) -> list[Configuration]:
    """Add every pair of causes; returns the best configurations with each first member."""
    best = []
    for first in range(len(blocks)):
        # each pair once: with causes that come later
        start = int(blocks.cause_edges[np.searchsorted(blocks.cause_edges, first, side="right")])
        if start == len(blocks):
            break
        sizes = range(blocks.log_weights.shape[1])
        together = blocks.log_factors_beside(blocks.acting([first], [[size] for size in sizes]), start)
        for size in sizes:
            member = Member(int(blocks.cause[first]), int(blocks.place[first]), size)
            logs = together[size] + blocks.log_weights[start:] + blocks.log_weights[first, size] + none
            best += sums.add_blocks(blocks, start, logs, (member,), scale)
    return best


def _add_triples(sums: _Sums, blocks: ActingBlocks, none: float, pairs: Sequence[Configuration]) -> None:
    """Add a third cause to good pairs; of a triple that extends several pairs the greatest sum counts."""
    number = {(c, p): k for k, (c, p) in enumerate(zip(blocks.cause.tolist(), blocks.place.tolist(), strict=True))}
    by_pair: dict[tuple[int, int], _Sums] = {}
    for pair in pairs:
        members = [number[member.cause, member.place] for member in pair.members]
        sizes = [member.size for member in pair.members]
        [factors] = blocks.log_factors_beside(blocks.acting(members, [sizes]))
        logs = factors + blocks.log_weights + none + blocks.log_weights[members, sizes].sum()
        extended = by_pair.setdefault((pair.members[0].cause, pair.members[1].cause), _Sums())
        extended.add_blocks(blocks, 0, logs, pair.members, pair.scale)
    merged: dict[frozenset[int], tuple[float, Configuration]] = {}
    for extended in by_pair.values():
        for causes, log in extended.logs.items():
            if causes not in merged or log > merged[causes][0]:
                merged[causes] = log, extended.best[causes]
    for causes, (log, best) in merged.items():
        sums.add(causes, log, best)
