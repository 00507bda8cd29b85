"""What the checks of a model take back of a verdict; they never choose between causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from warpbrain.inference.decide import CANNOT_SAY, NAMED, NAMED_AND_REST, Decision


@dataclass(frozen=True)
class Confirmation:
    """What a cause is worth where all others act.

    Attributes
    ----------
    name : str
    log_evidence : float
        Of the fit against that without the cause.
    heldout_log_density : float
        By how much held-out rows are more probable with it [nats].
    gain : (part, low, high)
        Of the held-out error of all rows that is gone with it, and its 95 % interval.
    placebo_p : float
        Probability that a pattern that means nothing does as well in its place.
    """

    name: str
    log_evidence: float
    heldout_log_density: float
    gain: tuple[float, float, float]
    placebo_p: float

    def why_not(self, alpha: float) -> str:
        """What keeps it from being named; empty if nothing does."""
        said = []
        if self.heldout_log_density <= 0.0:
            said.append("what was held out is not predicted better with it")
        if self.placebo_p > alpha:
            said.append("patterns that mean nothing predict as well")
        return " and ".join(said)


def after_checks(
    decision: Decision,
    confirmations: Sequence[Confirmation],
    p_left: float | None,
    alpha: float,
    grown: Sequence[str] = (),
    doubts: Sequence[str] = (),
) -> tuple[Decision, tuple[str, ...]]:
    """A verdict after its checks, and what failed in words.

    Names that fail are not spoken; without any other name, or where the error of what was held out grows, nothing can
    be said. Where anything is left a rest is said.

    Parameters
    ----------
    decision : Decision
        Of the posterior alone.
    confirmations : sequence of Confirmation
        Of each mechanism of the fit.
    p_left : float or None
        Probability of rows as far from the fit's model as these are.
    alpha : float
    grown, doubts : sequence of str
        Errors that are larger with what was added than without, in words: those that forbid any name, and others.
    """
    said = list(doubts)
    if decision.verdict not in (NAMED, NAMED_AND_REST):
        return decision, (*grown, *said)
    if p_left is not None and p_left <= alpha:
        said.append(f"Other causes would explain what is left (p = {p_left:.2g} that nothing is).")
    failed = {one.name: one.why_not(alpha) for one in confirmations if one.why_not(alpha)}
    said += [f"{name} is not named: {why}." for name, why in failed.items() if name in decision.causes]
    kept = tuple(name for name in decision.causes if name not in failed)
    if grown or not kept:
        return Decision(CANNOT_SAY, decision.causes), (*grown, *said)
    return (Decision(NAMED_AND_REST, kept) if said else decision), tuple(said)
