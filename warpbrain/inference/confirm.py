"""Checks of a verdict by held-out rows: names that fail are withdrawn; checks never choose between causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from warpbrain.inference.decide import CANNOT_SAY, NAMED, NAMED_AND_REST, NOTHING, Decision


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

    `decision`: of the posterior alone. `confirmations`: of each mechanism of the fit. `p_left`: p-value of the rows
    under the model of the fit. `grown`, `doubts`: in words: errors that are larger with the causes than without and
    forbid any name, and further doubts.
    """
    remarks = list(doubts)
    if decision.verdict not in (NAMED, NAMED_AND_REST):
        return decision, (*grown, *remarks)
    if p_left is not None and p_left <= alpha:
        remarks.append(f"Other causes would explain what is left (p = {p_left:.2g} if nothing were).")
    failed = {checked.name: why for checked in confirmations if (why := checked.why_not(alpha))}
    remarks += [f"{name} is not named: {why}." for name, why in failed.items() if name in decision.causes]
    kept = tuple(name for name in decision.causes if name not in failed)
    if grown or not kept:
        return Decision(CANNOT_SAY, decision.causes), (*grown, *remarks)
    return (Decision(NAMED_AND_REST, kept) if remarks else decision), tuple(remarks)
