"""What simpler methods make of the same cases: a linear dictionary with stepwise regression by BIC, and LASSO."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from referee.baselines.choosing import lasso, stepwise
from referee.baselines.dictionary import regression_of
from referee.intervals import Share, share
from referee.outcomes import Outcome
from referee.scores import PLAIN
from referee.threads import single
from warpbrain.cases.reading import read_case

METHODS = {"stepwise least squares, BIC": stepwise, "LASSO, BIC": lasso}


def compare(cases: Path, outcomes: Sequence[Outcome]) -> dict[str, dict[str, Share]]:
    """Shares of each method, under the names of the tool's."""
    # a fresh process knows nothing of the threads of this one
    with ProcessPoolExecutor(max_workers=os.cpu_count(), mp_context=get_context("spawn"), initializer=single) as pool:
        chosen = list(pool.map(_choose, [cases / outcome.name for outcome in outcomes]))
    said = {
        method: {outcome.name: names[method] for outcome, names in zip(outcomes, chosen, strict=True)}
        for method in METHODS
    }
    return {method: _shares(names, outcomes) for method, names in said.items()}


def _choose(case: Path) -> dict[str, str]:
    """What each method names in a case."""
    regression = regression_of(read_case(case))
    return {method: choose(regression) for method, choose in METHODS.items()}


def _shares(said: dict[str, str], outcomes: Sequence[Outcome]) -> dict[str, Share]:
    """An empty name is that nothing is missing."""
    effects = [o for o in outcomes if o.kind == "effect"]
    return {
        "false alarms": share(bool(said[o.name]) for o in outcomes if o.kind == "none"),
        "traps named as physics": share(bool(said[o.name]) for o in outcomes if o.kind == "trap"),
        "right name alone, d >= 8": share(o.right(said[o.name]) for o in effects if o.d >= PLAIN),
        "right name alone, the old d >= 8": share(o.right(said[o.name]) for o in effects if o.upper >= PLAIN),
        "spoken names right": share(o.right(said[o.name]) for o in outcomes if said[o.name]),
    }
