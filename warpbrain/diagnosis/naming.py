"""What is named, one mechanism beside the other.

Where one is named, what acts beside it is looked for next. Of a group of two none is named alone. But both may act:
each of them is looked for beside the other, and if the rule names both so, both are named.
"""

from __future__ import annotations

from collections.abc import Callable

from warpbrain.diagnosis.judging import Judgement
from warpbrain.diagnosis.stage import Stage

#: Mechanisms that are named at most.
_MOST = 3

#: What acts beside a kind that a stage has refitted: the next stage, and what it comes to.
Beside = Callable[[Stage, str], tuple[Stage, Judgement]]


def named_in_turn(first: Stage, at_first: Judgement, beside: Beside) -> tuple[list[Stage], list[Judgement]]:
    """Stages, and the judgement of each that names what the next one knows, until one names nothing.

    Parameters
    ----------
    first : Stage
        Of which nothing is known.
    at_first : Judgement
        Of that.
    beside : callable
    """
    stages, judged = [first], [at_first]
    both = _both(first, at_first, beside)
    if both is not None:
        stage, *judged = both
        stages.append(stage)
    while len(stages) < _MOST and judged[-1].verdict.adds:
        stage, judgement = beside(stages[-1], judged[-1].verdict.kinds[0])
        stages.append(stage)
        judged.append(judgement)
    return stages, judged


def _both(first: Stage, at_first: Judgement, beside: Beside) -> tuple[Stage, Judgement, Judgement] | None:
    """Of a group of two that are named beside each other: the stage beside the first, and the judgements that name
    the first and the second; None if it is no such group."""
    kinds = at_first.verdict.kinds
    if at_first.verdict.adds or len(kinds) != 2 or not all(kind in first.fits for kind in kinds):
        return None
    stage, second = beside(first, kinds[0])
    if not second.verdict.adds or second.verdict.kinds != kinds[1:]:
        return None
    _, one = beside(first, kinds[1])
    return (stage, one, second) if one.verdict.adds and one.verdict.kinds == kinds[:1] else None
