"""Which causes a sparse solution names."""

from __future__ import annotations

import numpy as np

from referee.challenge.neutral import Floats, Strings

#: Part of what all causes together weigh that one has at least which is named.
NAMED = 0.3


def weights(amounts: Floats, causes: Strings) -> dict[str, float]:
    """Sum of absolute amounts of columns of unit length, by cause; of those that have any."""
    by_cause = {str(cause): float(np.abs(amounts[causes == cause]).sum()) for cause in np.unique(causes)}
    return {cause: weight for cause, weight in by_cause.items() if weight > 0.0}


def named(weighed: dict[str, float]) -> tuple[str, ...]:
    """Causes with a part of `NAMED` or more, the heaviest first; the heaviest if none has."""
    total = sum(weighed.values())
    ordered = sorted(weighed, key=lambda cause: (-weighed[cause], cause))
    return tuple(cause for cause in ordered if weighed[cause] >= NAMED * total) or tuple(ordered[:1])
