"""The verdict of least expected loss under the posterior over sets of causes, and what checks leave of it.

Every possible verdict is compared under every set that may be true; what a wrong one costs stands in one table,
`calibration.json`. No other number decides. Held-out rows check a verdict: names that fail are withdrawn; checks never
choose between causes.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from warpbrain.arrays import Floats
from warpbrain.inference.causes import Hypothesis, Kind

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
    """A verdict, and the causes that it is about."""

    verdict: str
    causes: tuple[str, ...] = ()

    @property
    def named(self) -> tuple[str, ...]:
        """Mechanisms that it names; none of the verdicts that name none."""
        return self.causes if self.verdict in (NAMED, NAMED_AND_REST) else ()


@dataclass(frozen=True)
class Truth:
    """A set of causes that may be true: its mechanisms, whether an unknown acts, and what is no physics."""

    mechanisms: frozenset[str]
    unknown: bool
    not_physics: frozenset[str]

    @classmethod
    def of(cls, hypothesis: Hypothesis) -> Truth:
        """Of a set of causes."""
        return cls(
            frozenset(hypothesis.of_kind(Kind.PHYSICS)),
            bool(hypothesis.of_kind(Kind.UNKNOWN)),
            frozenset(hypothesis.of_kind(Kind.NOT_PHYSICS)),
        )

    @property
    def physical(self) -> bool:
        """Whether any physics is missing."""
        return self.unknown or bool(self.mechanisms)


def decide(
    hypotheses: Sequence[Hypothesis], probabilities: Floats, losses: Mapping[str, float]
) -> tuple[Decision, dict[Decision, float]]:
    """The best verdict, and the expected loss of all that were compared.

    `probabilities` (h,). `losses`: see `Calibration`.
    """
    truths = [Truth.of(hypothesis) for hypothesis in hypotheses]
    expected = {
        decision: sum(p * loss(decision, truth, losses) for p, truth in zip(probabilities, truths, strict=True))
        for decision in decisions(truths, probabilities)
    }
    return min(expected, key=lambda decision: expected[decision]), expected


def decisions(truths: Sequence[Truth], probabilities: Floats) -> list[Decision]:
    """Verdicts worth comparing: about mechanisms that are in probable sets."""
    names = _most_probable([truth.mechanisms for truth in truths], probabilities)[:4]
    errors = _most_probable([truth.not_physics for truth in truths], probabilities)[:2]
    verdicts = [Decision(NOTHING), Decision(CANNOT_SAY), Decision(UNKNOWN)]
    verdicts += [Decision(NOT_PHYSICS, (name,)) for name in errors]
    for named in _subsets(names, range(1, 4)):
        verdicts += [Decision(NAMED, named), Decision(NAMED_AND_REST, named)]
    return verdicts + [Decision(GROUP, group) for group in _subsets([*names, UNKNOWN], range(2, 5))]


def _most_probable(sets: Sequence[frozenset[str]], probabilities: Floats) -> list[str]:
    """Names in any of the sets, the most probable first."""
    total: dict[str, float] = {}
    for names, p in zip(sets, probabilities.tolist(), strict=True):
        for name in names:
            total[name] = total.get(name, 0.0) + p
    return sorted(total, key=lambda name: -total[name])


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
        if truth.physical:
            # silent about the physics, as "nothing missing" is; and a false name where the error does not act
            acts = decision.causes[0] in truth.not_physics
            return losses["nothing for something"] + losses["false name"] * (not acts)
        # where no physics is missing to take nothing for an error costs what the reverse does
        wrong = losses["name left out"] * (decision.causes[0] not in truth.not_physics)
        return wrong if truth.not_physics else losses["nothing for something"]
    if not truth.physical:
        return losses["name where nothing is"]
    if decision.verdict == UNKNOWN:
        return losses["name left out" if truth.unknown else "unknown for a mechanism"] * bool(truth.mechanisms)
    if decision.verdict == GROUP:
        return _group(decision, truth, losses)
    return _named(decision, truth, losses)


def _group(decision: Decision, truth: Truth, losses: Mapping[str, float]) -> float:
    inside = len(truth.mechanisms.intersection(decision.causes)) + (truth.unknown and UNKNOWN in decision.causes)
    if not inside:
        return losses["false group"]
    # a group tells that one of its members acts: any further one is left out
    left_out = len(truth.mechanisms.difference(decision.causes)) + inside - 1
    return losses["member of a group"] * len(decision.causes) + losses["name left out"] * left_out


def _named(decision: Decision, truth: Truth, losses: Mapping[str, float]) -> float:
    false = len(set(decision.causes) - truth.mechanisms)
    left_out = len(truth.mechanisms.difference(decision.causes))
    cost = losses["false name"] * false + losses["name left out"] * left_out
    # "and rest" tells of causes that are left out, without their names
    rest = left_out > 0 or truth.unknown
    if decision.verdict == NAMED_AND_REST:
        return cost + losses["rest where nothing is"] * (not rest)
    return cost + losses["rest left out"] * rest


@dataclass(frozen=True)
class Confirmation:
    """What a cause of a fit explains that those of it that explain more do not."""

    name: str
    log_evidence: float  # log Bayes factor of a set with these over that without the cause
    heldout_log_density: float  # by how much held-out rows are more probable with it [nats]
    #: (part, low, high): part of the held-out error of all rows that it removes, and its 95 % interval.
    gain: tuple[float, float, float]
    placebo_p: float  # p-value among random patterns in its place, by what they predict of held-out rows

    def why_not(self, alpha: float) -> str:
        """Why it is not named; empty if it is."""
        reasons = []
        if self.heldout_log_density <= 0.0:
            reasons.append("what was held out is not predicted better with it")
        if self.placebo_p > alpha:
            reasons.append("patterns that mean nothing predict as well")
        return " and ".join(reasons)


def if_significant(decision: Decision, p_value: float, alpha: float) -> Decision:
    """The verdict where the rows are significant (`p_value <= alpha`), else `cannot say` about the same causes.

    `nothing missing` claims nothing and stays. `p_value`: of the hypothesis that no cause acts.
    """
    if p_value <= alpha or decision.verdict == NOTHING:
        return decision
    return Decision(CANNOT_SAY, decision.causes)


def after_checks(
    decision: Decision,
    confirmations: Sequence[Confirmation],
    p_left: float | None,
    alpha: float,
    grown: Sequence[str] = (),
    doubts: Sequence[str] = (),
) -> tuple[Decision, tuple[str, ...]]:
    """A verdict after its checks, and what failed in words.

    Causes that fail are not named. Without any other name, or where the held-out error grows, nothing can be said.
    Where a check shows that something is left the verdict says so.

    `decision`: of the posterior alone.
    `confirmations`: of each mechanism of the fit.
    `p_left`: p-value of the rows under the model of the fit.
    `grown`, `doubts`: in words: errors that are larger with the causes than without and forbid any name, and further
    doubts.
    """
    remarks = list(doubts)
    if not decision.named:
        return decision, (*grown, *remarks)
    if p_left is not None and p_left <= alpha:
        remarks.append(f"Other causes would explain what is left (p = {p_left:.2g} if nothing were).")
    failed = {checked.name: why for checked in confirmations if (why := checked.why_not(alpha))}
    remarks += [f"{name} is not named: {why}." for name, why in failed.items() if name in decision.causes]
    kept = tuple(name for name in decision.causes if name not in failed)
    if grown or not kept:
        return Decision(CANNOT_SAY, decision.causes), (*grown, *remarks)
    return (Decision(NAMED_AND_REST, kept) if remarks else decision), tuple(remarks)
