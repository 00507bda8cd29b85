"""From stages to one of the seven verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from warpbrain.diagnosis.result import CANNOT_SAY, GROUP, NAMED, NAMED_AND_REST, NOT_PHYSICS, NOTHING, UNKNOWN
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


def conclude(stages: Sequence[Stage], alpha: float) -> Conclusion:
    """The verdict: what was accepted, stage by stage, and what the last stage leaves.

    Physics that was named with nothing significant left is `named`; with something left, `named + rest`. Where nothing
    was named, what is left decides: a few kinds of physics are a group, smooth changes without a name the unknown.
    """
    accepted = [stage.accepted for stage in stages if stage.accepted is not None]
    kinds = tuple(dict.fromkeys(one.kind for one in accepted if one.physics))
    others = tuple(dict.fromkeys(one.kind for one in accepted if not one.physics))
    last = stages[-1]
    if not accepted and last.p_value > alpha:
        return Conclusion(NOTHING, (), (), "")
    left = last.p_value <= alpha
    group = last.label_set if left and last.accepted is None else ()
    if kinds:
        return Conclusion(NAMED_AND_REST if left else NAMED, kinds, _physics(last, group), last.why)
    if others and not left:
        return Conclusion(NOT_PHYSICS, others, (), "")
    if 1 < len(group) <= MEMBERS and _physics(last, group) == group and last.gain[0] > 0.0:
        return Conclusion(GROUP, (), group, last.why)
    if others:
        return Conclusion(NOT_PHYSICS, others, (), last.why)
    if group and group[0] == UNKNOWN_KIND:
        return Conclusion(UNKNOWN, (), (), last.why)
    return Conclusion(CANNOT_SAY, (), group, last.why)


def _physics(stage: Stage, kinds: Sequence[str]) -> tuple[str, ...]:
    physics = {one.kind for one in stage.candidates if one.physics}
    return tuple(kind for kind in kinds if kind in physics)
