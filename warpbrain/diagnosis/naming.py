"""What is named, one mechanism beside the other.

Where one is named, what acts beside it is looked for next. Where two act, either alone may explain too little to be
named: the verdict is a group of them, or a force without a name fits better than each. So each is looked for beside
the other, and if the rule names both so, and both together are probable enough against a force without a name, both are
named.
"""

from __future__ import annotations

from collections.abc import Callable

from warpbrain.diagnosis.calibration import probabilities
from warpbrain.diagnosis.judging import Judgement
from warpbrain.diagnosis.result import GROUP, UNKNOWN
from warpbrain.diagnosis.screening import UNKNOWN as UNKNOWN_KIND
from warpbrain.diagnosis.stage import Stage
from warpbrain.diagnosis.verdict import SURE

#: Mechanisms that are named at most.
_MOST = 3

#: What acts beside a kind of a stage: the next stage, and what it comes to; None if the kind has no fit.
Beside = Callable[[Stage, str], tuple[Stage, Judgement] | None]


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
        found = beside(stages[-1], judged[-1].verdict.kinds[0])
        if found is None:
            break
        stages.append(found[0])
        judged.append(found[1])
    return stages, judged


def _both(first: Stage, at_first: Judgement, beside: Beside) -> tuple[Stage, Judgement, Judgement] | None:
    """Two that are named beside each other: the stage beside the first of them, and the judgements that name the first
    and the second; None if there are none, or they are not to be looked for.

    They are a group of two; or where a force without a name fits better, or about as well, the best one and what is
    named beside it, however little that explains alone.
    """
    verdict = at_first.verdict
    fitted = [one.kind for one in at_first.ranking if one.physics and one.kind in first.fits]
    group = len(verdict.kinds) == 2 and set(verdict.kinds) <= set(fitted)
    nameless = verdict.verdict == UNKNOWN or (verdict.verdict == GROUP and UNKNOWN_KIND in verdict.kinds)
    if verdict.adds or not fitted or not (group or nameless):
        return None
    best = verdict.kinds[0] if group else fitted[0]
    found = beside(first, best)
    if found is None or not found[1].verdict.adds:
        return None
    stage, second = found
    [other] = second.verdict.kinds
    # one kind twice is beside itself whatever acts: two tractions are what a wire between two places comes to
    if other == best or (group and other not in verdict.kinds) or not _beat_the_unknown(at_first, best, second):
        return None
    turned = beside(first, other)
    if turned is None or not turned[1].verdict.adds or turned[1].verdict.kinds != (best,):
        return None
    return stage, turned[1], second


def _beat_the_unknown(at_first: Judgement, best: str, second: Judgement) -> bool:
    """Whether two together are probable enough against a force without a name in their place."""
    alone, beside = ({one.kind: one.log_evidence for one in each.ranking} for each in (at_first, second))
    log_evidence = {"both": alone[best] + beside[second.verdict.kinds[0]], UNKNOWN_KIND: alone[UNKNOWN_KIND]}
    return probabilities(log_evidence, frozenset())["both"] >= SURE
