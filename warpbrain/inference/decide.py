"""The verdict of least expected loss under the posterior over sets of causes.

Every verdict that could be spoken is compared under every set that may be true; what a wrong one costs stands in one
table, `calibration.json`. No other number decides.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.inference.causes import Kind
from warpbrain.inference.subsets import Hypothesis

Floats = NDArray[np.float64]

#: The seven verdicts.
NOTHING, NAMED, GROUP, NAMED_AND_REST, UNKNOWN, NOT_PHYSICS, CANNOT_SAY = VERDICTS = (
    "nothing missing",
    "named",
    "group",
    "named + rest",
    "unknown",
    "not physics",
    "cannot say",
)


@dataclass(frozen=True)
class Decision:
    """A verdict, and the causes that it speaks of."""

    verdict: str
    causes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Truth:
    """What a set of causes says: mechanisms by name, whether something has no name, and what is no physics."""

    mechanisms: frozenset[str]
    unknown: bool
    not_physics: frozenset[str]

    @classmethod
    def of(cls, hypothesis: Hypothesis) -> Truth:
        """Of a set of causes."""

        def named(kind: Kind) -> frozenset[str]:
            each = zip(hypothesis.causes, hypothesis.kinds, strict=True)
            return frozenset(cause for cause, own in each if own is kind)

        return cls(named(Kind.PHYSICS), bool(named(Kind.UNKNOWN)), named(Kind.NOT_PHYSICS))

    @property
    def physical(self) -> bool:
        """Whether any physics is missing."""
        return self.unknown or bool(self.mechanisms)


def decide(
    hypotheses: Sequence[Hypothesis], probabilities: Floats, losses: Mapping[str, float]
) -> tuple[Decision, dict[Decision, float]]:
    """The best verdict, and the expected loss of all that were compared.

    Parameters
    ----------
    hypotheses : sequence of Hypothesis
    probabilities : (h,) array
    losses : mapping of str to float
        See `Calibration`.
    """
    truths = [Truth.of(one) for one in hypotheses]
    expected = {
        decision: sum(p * loss(decision, truth, losses) for p, truth in zip(probabilities, truths, strict=True))
        for decision in decisions(truths, probabilities)
    }
    return min(expected, key=lambda decision: expected[decision]), expected


def decisions(truths: Sequence[Truth], probabilities: Floats, most: int = 4) -> list[Decision]:
    """Verdicts worth comparing: about mechanisms that are in probable sets."""
    mass: dict[str, float] = {}
    for truth, p in zip(truths, probabilities.tolist(), strict=True):
        for name in truth.mechanisms:
            mass[name] = mass.get(name, 0.0) + p
    names = sorted(mass, key=lambda name: -mass[name])[:most]
    wrong: dict[str, float] = {}
    for truth, p in zip(truths, probabilities.tolist(), strict=True):
        for name in truth.not_physics:
            wrong[name] = wrong.get(name, 0.0) + p
    found = [Decision(NOTHING), Decision(CANNOT_SAY), Decision(UNKNOWN)]
    found += [Decision(NOT_PHYSICS, (name,)) for name in sorted(wrong, key=lambda name: -wrong[name])[:2]]
    for named in _subsets(names, range(1, 4)):
        found += [Decision(NAMED, named), Decision(NAMED_AND_REST, named)]
    return found + [Decision(GROUP, group) for group in _subsets([*names, UNKNOWN], range(2, 5)) if group[0] != UNKNOWN]


def _subsets(names: Sequence[str], sizes: Iterable[int]) -> list[tuple[str, ...]]:
    return [subset for size in sizes for subset in itertools.combinations(names, size)]


def loss(decision: Decision, truth: Truth, losses: Mapping[str, float]) -> float:
    """What a verdict costs where a set of causes is true."""
    if decision.verdict == CANNOT_SAY:
        something = truth.physical or bool(truth.not_physics)
        return losses["cannot say"] if something else losses["cannot say where nothing is"]
    if decision.verdict == NOTHING:
        return losses["nothing for something"] * (truth.physical or bool(truth.not_physics))
    if decision.verdict == NOT_PHYSICS:
        return _not_physics(decision, truth, losses)
    if not truth.physical:
        return losses["name where nothing is"]
    if decision.verdict == UNKNOWN:
        return losses["name left out" if truth.unknown else "unknown for a mechanism"] * bool(truth.mechanisms)
    if decision.verdict == GROUP:
        return _group(decision, truth, losses)
    return _named(decision, truth, losses)


def _not_physics(decision: Decision, truth: Truth, losses: Mapping[str, float]) -> float:
    if truth.physical:
        return losses["not physics for physics"]
    if not truth.not_physics:
        return losses["name where nothing is"]
    return losses["name left out"] * (decision.causes[0] not in truth.not_physics)


def _group(decision: Decision, truth: Truth, losses: Mapping[str, float]) -> float:
    inside = truth.mechanisms.intersection(decision.causes) or (truth.unknown and UNKNOWN in decision.causes)
    if not inside:
        return losses["false group"]
    outside = len(truth.mechanisms.difference(decision.causes))
    return losses["member of a group"] * len(decision.causes) + losses["name left out"] * outside


def _named(decision: Decision, truth: Truth, losses: Mapping[str, float]) -> float:
    false = len(set(decision.causes) - truth.mechanisms)
    left = len(truth.mechanisms.difference(decision.causes))
    cost = losses["false name"] * false
    if decision.verdict == NAMED_AND_REST:
        # a rest that is said stands for what is left, without its name
        cost += losses["name left out"] * left
        return cost + losses["rest where nothing is"] * (left == 0 and not truth.unknown)
    return cost + losses["name left out"] * left + losses["rest left out"] * truth.unknown
