"""Probabilities of sets of causes: none, each, every pair, and triples that begin with good pairs, in closed form.

The sums over places, sizes and the scale of the noise are carried out; a set is as probable as its sum says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.inference.blocks import Blocks
from warpbrain.inference.causes import Cause, Kind
from warpbrain.inference.gaussian import GaussianModel

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Member:
    """A cause of a hypothesis by its number, the number of its place and that of its size."""

    cause: int
    place: int
    size: int


@dataclass(frozen=True)
class Configuration:
    """Causes with places and sizes at a scale of the noise, and the log of its joint density with the rows."""

    members: tuple[Member, ...]
    scale: float
    log_density: float


@dataclass(frozen=True)
class Hypothesis:
    """A set of causes.

    Attributes
    ----------
    causes : tuple of str
    kinds : tuple of Kind
        Of each of them.
    log_evidence : float
        Log density of the rows, summed over places, sizes and scales.
    log_prior : float
        Sum of the log odds of its causes.
    best : Configuration
        The most probable one.
    """

    causes: tuple[str, ...]
    kinds: tuple[Kind, ...]
    log_evidence: float
    log_prior: float
    best: Configuration


@dataclass(frozen=True, eq=False)
class Posterior:
    """Probabilities of sets of causes, the most probable first."""

    hypotheses: tuple[Hypothesis, ...]

    @property
    def probabilities(self) -> Floats:
        """Of each hypothesis."""
        from scipy.special import softmax

        return np.asarray(softmax([one.log_evidence + one.log_prior for one in self.hypotheses]))

    def probability(self, *causes: str) -> float:
        """That exactly these causes act."""
        each = zip(self.hypotheses, self.probabilities.tolist(), strict=True)
        return sum(p for one, p in each if frozenset(one.causes) == frozenset(causes))

    def marginal(self, cause: str) -> float:
        """That a cause acts, whatever else does."""
        each = zip(self.hypotheses, self.probabilities.tolist(), strict=True)
        return sum(p for one, p in each if cause in one.causes)


@dataclass(frozen=True, eq=False)
class Search:
    """How far sets are looked for.

    Parameters
    ----------
    scales, log_scale_prior : (k,) array
        Factors on the noise that are summed over, and the log probability of each.
    places : int
        Best places of each cause of which pairs are made.
    beam : int
        Best configurations of pairs to which a third cause is added at each scale; 0: no triples.
    most : int
        Causes of a set at most.
    negligible : float
        A scale at which no single cause has this part of the greatest density is left out of pairs and triples.
    """

    scales: Floats
    log_scale_prior: Floats
    places: int = 50
    beam: int = 30
    most: int = 3
    negligible: float = 1e-4


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
        self, blocks: Blocks, start: int, logs: Floats, members: tuple[Member, ...], scale: float
    ) -> list[Configuration]:
        """Add densities (p, s) of blocks from `start` on beside members; returns the best with each cause."""
        taken = {member.cause for member in members}
        cause = blocks.cause[start:]
        firsts = np.flatnonzero(np.diff(cause, prepend=-1))
        best = []
        for low, high in zip(firsts.tolist(), [*firsts[1:].tolist(), len(cause)], strict=True):
            if cause[low] in taken:
                continue
            some = logs[low:high]
            row, size = np.unravel_index(int(np.argmax(some)), some.shape)
            last = Member(int(cause[low]), int(blocks.place[start + low + row]), int(size))
            best.append(Configuration((*members, last), scale, float(some[row, size])))
            self.add(frozenset(taken | {last.cause}), float(np.logaddexp.reduce(some, axis=None)), best[-1])
        return best


def posterior(model: GaussianModel, residual: Floats, causes: Sequence[Cause], search: Search) -> Posterior:
    """Probabilities of sets of at most three causes.

    Parameters
    ----------
    model : GaussianModel
        Of rows (n,) on which no cause acts.
    residual : (n,) array
    causes : sequence of Cause
    search : Search
    """
    sums = _Sums()
    by_scale: list[tuple[float, float, Blocks, Floats]] = []
    scales = search.scales.tolist()
    at_scales = Blocks.at_scales(model, scales, residual, causes) if causes else iter([None] * len(scales))
    for scale, log_prior, blocks in zip(scales, search.log_scale_prior.tolist(), at_scales, strict=True):
        none = float(model.with_scale(scale).log_density(residual)) + log_prior
        sums.add(frozenset(), none, Configuration((), scale, none))
        if blocks is not None:
            logs = blocks.log_factors() + blocks.log_weights + none
            sums.add_blocks(blocks, 0, logs, (), scale)
            by_scale.append((scale, none, blocks, logs))
    greatest = max((float(logs.max()) for *_, logs in by_scale), default=0.0)
    for scale, none, blocks, logs in by_scale:
        if min(len(causes), search.most) > 1 and logs.max() >= greatest + np.log(search.negligible):
            kept = blocks.some(_best_places(blocks, logs, search.places))
            pairs = _add_pairs(sums, kept, none, scale)
            pairs.sort(key=lambda one: -one.log_density)
            _add_triples(sums, kept, none, pairs[: search.beam] if min(len(causes), search.most) > 2 else [])
    found = [
        Hypothesis(
            tuple(causes[c].name for c in sorted(members)),
            tuple(causes[c].kind for c in sorted(members)),
            log,
            sum(causes[c].log_prior for c in members),
            sums.best[members],
        )
        for members, log in sums.logs.items()
    ]
    return Posterior(tuple(sorted(found, key=lambda one: -(one.log_evidence + one.log_prior))))


def likely_places(
    model: GaussianModel, residual: Floats, causes: Sequence[Cause], most: int
) -> dict[str, NDArray[np.int64]]:
    """Numbers of the most probable places of each cause by its name, alone and at the scale of a model.

    Parameters
    ----------
    model : GaussianModel
        Of rows (n,) on which no cause acts.
    residual : (n,) array
    causes : sequence of Cause
    most : int
        Places of each cause at most.
    """
    blocks = Blocks(model, residual, causes)
    chosen = _best_places(blocks, blocks.log_factors() + blocks.log_weights, most)
    return {cause.name: blocks.place[chosen[blocks.cause[chosen] == c]] for c, cause in enumerate(causes)}


def _best_places(blocks: Blocks, logs: Floats, most: int) -> NDArray[np.int64]:
    """Numbers of the best blocks of each cause."""
    of_block = np.logaddexp.reduce(logs, axis=1)
    chosen = []
    for cause in np.unique(blocks.cause).tolist():
        numbers = np.flatnonzero(blocks.cause == cause)
        chosen.append(numbers[np.argsort(-of_block[numbers])[:most]])
    return np.concatenate(chosen)


def _add_pairs(sums: _Sums, blocks: Blocks, none: float, scale: float) -> list[Configuration]:
    """Add every pair of causes; returns the best configurations with each first member."""
    best = []
    for first in range(len(blocks)):
        # pairs are counted once: with causes that come later
        start = int(np.searchsorted(np.cumsum(np.diff(blocks.cause, prepend=-1) != 0), _rank(blocks, first) + 1))
        if start == len(blocks):
            break
        for size in range(blocks.log_weights.shape[1]):
            member = Member(int(blocks.cause[first]), int(blocks.place[first]), size)
            together = blocks.log_factors(blocks.given([(first, size)]), start)
            logs = together + blocks.log_weights[start:] + blocks.log_weights[first, size] + none
            best += sums.add_blocks(blocks, start, logs, (member,), scale)
    return best


def _rank(blocks: Blocks, number: int) -> int:
    """Which of the causes, in the order of the blocks, a block belongs to, from 1."""
    return int(np.cumsum(np.diff(blocks.cause, prepend=-1) != 0)[number])


def _add_triples(sums: _Sums, blocks: Blocks, none: float, pairs: Sequence[Configuration]) -> None:
    """Add a third cause to good pairs; of a triple that several pairs lead to the greatest sum counts."""
    number = {(c, p): k for k, (c, p) in enumerate(zip(blocks.cause.tolist(), blocks.place.tolist(), strict=True))}
    by_pair: dict[tuple[int, int], _Sums] = {}
    for pair in pairs:
        rows = [(number[member.cause, member.place], member.size) for member in pair.members]
        logs = blocks.log_factors(blocks.given(rows)) + blocks.log_weights + none
        logs = logs + sum(blocks.log_weights[row] for row in rows)
        beside = by_pair.setdefault((pair.members[0].cause, pair.members[1].cause), _Sums())
        beside.add_blocks(blocks, 0, logs, pair.members, pair.scale)
    merged: dict[frozenset[int], tuple[float, Configuration]] = {}
    for beside in by_pair.values():
        for causes, log in beside.logs.items():
            if causes not in merged or log > merged[causes][0]:
                merged[causes] = log, beside.best[causes]
    for causes, (log, best) in merged.items():
        sums.add(causes, log, best)
