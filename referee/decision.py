"""The verdict of least expected loss by the tool's table: of the optimal analyst, and to price false names."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from referee.diagnoses import NOT_PHYSICS, UNKNOWN

#: Names of mechanisms and `UNKNOWN`, or `NOT_PHYSICS` alone; the empty set is that nothing acts.
Causes = frozenset[str]
#: Probabilities of sets of causes.
Posterior = Mapping[Causes, float]

_NOTHING: Causes = frozenset()
#: Mechanisms that are considered for names and groups.
_MOST = 4


@dataclass(frozen=True)
class Decision:
    """A verdict with the causes that it names or holds to be possible, and the probability that they act."""

    verdict: str
    causes: tuple[str, ...] = ()
    probability: float = 0.0


def decide(posterior: Posterior, losses: Mapping[str, float]) -> Decision:
    """The verdict of least expected loss; `losses` as in the tool's `calibration.json`."""

    def expected(one: Decision) -> float:
        return sum(p * loss(one, true, losses) for true, p in posterior.items())

    best = min(_considered(posterior), key=expected)
    return Decision(best.verdict, best.causes, sum(p for true, p in posterior.items() if set(best.causes) <= true))


def _considered(posterior: Posterior) -> Iterator[Decision]:
    mass: dict[str, float] = {}
    for true, p in posterior.items():
        for name in true - {NOT_PHYSICS, UNKNOWN}:
            mass[name] = mass.get(name, 0.0) + p
    names = sorted(mass, key=lambda name: -mass[name])[:_MOST]
    yield from map(Decision, ("nothing missing", "cannot say", "unknown", "not physics"))
    for size in range(1, 4):
        for named in itertools.combinations(names, size):
            yield Decision("named", named)
            yield Decision("named + rest", named)
    for size in range(2, 5):
        for group in itertools.combinations([*names, UNKNOWN], size):
            yield Decision("group", group)


def loss(decision: Decision, true: Causes, losses: Mapping[str, float]) -> float:
    """What a verdict costs where a set of causes acts."""
    mechanisms, unknown = true - {UNKNOWN, NOT_PHYSICS}, UNKNOWN in true
    physical = bool(mechanisms) or unknown
    if decision.verdict == "cannot say":
        return losses["cannot say" if true else "cannot say where nothing is"]
    if decision.verdict == "nothing missing":
        return losses["nothing for something"] * bool(true)
    if decision.verdict == "not physics" and physical:
        return losses["not physics for physics"]
    if decision.verdict == "not physics" or not physical:
        return losses["name where nothing is"] * (decision.verdict != "not physics" or not true)
    if decision.verdict == "unknown":
        return losses["name left out" if unknown else "unknown for a mechanism"] * bool(mechanisms)
    left = losses["name left out"] * len(mechanisms.difference(decision.causes))
    if decision.verdict == "group":
        holds = bool(true.intersection(decision.causes))
        return losses["member of a group"] * len(decision.causes) + left if holds else losses["false group"]
    cost = losses["false name"] * len(set(decision.causes) - mechanisms)
    if decision.verdict == "named + rest":
        # a rest that has a name is left out as well
        return cost + left + losses["rest where nothing is"] * (not left and not unknown)
    return cost + left + losses["rest left out"] * unknown
