"""What well-known methods make of the same cases, from the neutral format of the challenge alone.

None of them imports `warpbrain`. See docs/challenge.md.
"""

from __future__ import annotations

from collections.abc import Callable

from referee.baselines.discrepancy import discrepancy
from referee.baselines.forward_selection import forward_selection
from referee.baselines.lasso import lasso
from referee.baselines.relevance_vector import relevance_vector
from referee.baselines.whitened import Whitened, whitened
from referee.challenge.answers import Answer
from referee.challenge.neutral import NeutralCase

METHODS: dict[str, Callable[[Whitened], Answer]] = {
    "forward-selection": forward_selection,
    "lasso": lasso,
    "relevance-vector": relevance_vector,
    "gp-discrepancy": discrepancy,
}


def answers_of(case: NeutralCase) -> dict[str, Answer]:
    """What each method says of a case."""
    problem = whitened(case)
    return {name: method(problem) for name, method in METHODS.items()}
