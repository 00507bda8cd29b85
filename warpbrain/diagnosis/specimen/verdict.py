"""From stages to one of the seven verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from warpbrain.diagnosis.result import CANNOT_SAY, GROUP, NAMED, NAMED_AND_REST, NOT_PHYSICS, NOTHING, UNKNOWN
from warpbrain.diagnosis.specimen.confirming import Confirmation
from warpbrain.diagnosis.specimen.stage import UNKNOWN as UNKNOWN_KIND
from warpbrain.diagnosis.specimen.stage import Stage
from warpbrain.diagnosis.verdict import MEMBERS


@dataclass(frozen=True)
class Conclusion:
    """What all stages come to.

    Attributes
    ----------
    verdict : str
    kinds : tuple of str
        Physics that is named, in order, each once; of what is not physics, that.
    group : tuple of str
        Kinds of the last stage that are not told apart.
    why : str
        What kept a name from being spoken at the last stage.
    """

    verdict: str
    kinds: tuple[str, ...]
    group: tuple[str, ...]
    why: str

    @property
    def named(self) -> bool:
        """Whether physics is named."""
        return self.verdict in (NAMED, NAMED_AND_REST)


def conclude(stages: Sequence[Stage], confirmations: Sequence[Confirmation], alpha: float) -> Conclusion:
    """The verdict: what was added, stage by stage, what of it was confirmed, and what the last stage leaves.

    Physics that was confirmed with nothing significant left is `named`; with something left, or with something added
    that was not confirmed, `named + rest`. Where nothing was confirmed, what is left decides: a few kinds of physics
    are a group, smooth changes without a name the unknown.
    """
    accepted = [stage.accepted for stage in stages if stage.accepted is not None]
    kinds = tuple(one.kind for one in confirmations if not one.why_not)
    failed = tuple(one for one in confirmations if one.why_not)
    doubts = "; ".join(f"{one.kind}: {one.why_not}" for one in failed)
    others = tuple(dict.fromkeys(one.kind for one in accepted if not one.physics))
    last = stages[-1]
    if not accepted and last.p_value > alpha:
        return Conclusion(NOTHING, (), (), "")
    left = last.p_value <= alpha
    group = last.label_set if left and last.accepted is None else ()
    why = "; ".join(text for text in (doubts, last.why) if text)
    if kinds:
        rest = left or bool(failed)
        among = (*(one.kind for one in failed), *_physics(last, group))
        return Conclusion(NAMED_AND_REST if rest else NAMED, kinds, among, why)
    if failed:
        return Conclusion(CANNOT_SAY, (), tuple(one.kind for one in failed), why)
    if others and not left:
        return Conclusion(NOT_PHYSICS, others, (), "")
    if 1 < len(group) <= MEMBERS and _physics(last, group) == group:
        return Conclusion(GROUP, (), group, why)
    if others:
        return Conclusion(NOT_PHYSICS, others, (), why)
    if group and group[0] == UNKNOWN_KIND:
        return Conclusion(UNKNOWN, (), (), why)
    return Conclusion(CANNOT_SAY, (), group, why)


def _physics(stage: Stage, kinds: Sequence[str]) -> tuple[str, ...]:
    physics = {one.kind for one in stage.candidates if one.physics}
    return tuple(kind for kind in kinds if kind in physics)
