"""What is named in the end: each kind as it is in the fit with all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from warpbrain.diagnosis.averaging import averaged_values
from warpbrain.diagnosis.judging import Judgement
from warpbrain.diagnosis.result import Ranked
from warpbrain.diagnosis.stage import Stage


def named_together(stages: Sequence[Stage], judged: Sequence[Judgement]) -> tuple[Ranked, ...]:
    """What is named, each with the size that it has in the fit with all of them."""
    found = []
    for one in judged:
        if not one.verdict.adds:
            break
        found.append(next(ranked for ranked in one.ranking if ranked.kind == one.verdict.kinds[0]))
    if not found:
        return ()
    final = stages[len(found) - 1].fits[found[-1].kind]
    # the last one was judged by this very fit
    for k, effect in enumerate(final.effects[:-1]):
        if effect.proposed.of_patch is not None:
            # where it lets go was averaged over places
            continue
        values = averaged_values(stages[k], found[k].kind, final, k)
        own = {value.name for value in values}
        # what was averaged over places and levels stays as it was found
        found[k] = replace(found[k], values=(*values, *(v for v in found[k].values if v.name not in own)))
    return tuple(found)
