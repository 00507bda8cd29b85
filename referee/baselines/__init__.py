"""What simpler methods make of the same cases: a linear dictionary with stepwise regression by BIC, and LASSO."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from referee.baselines.choosing import lasso, stepwise
from referee.baselines.dictionary import regression_of
from referee.intervals import Share, share
from referee.outcomes import Outcome
from referee.scores import PLAIN
from warpbrain.cases.reading import read_case

METHODS = {"stepwise least squares, BIC": stepwise, "LASSO, BIC": lasso}


def compare(cases: Path, outcomes: Sequence[Outcome]) -> dict[str, dict[str, Share]]:
    """Shares of each method, under the names of the tool's."""
    said: dict[str, dict[str, str]] = {method: {} for method in METHODS}
    for outcome in outcomes:
        regression = regression_of(read_case(cases / outcome.name))
        for method, choose in METHODS.items():
            said[method][outcome.name] = choose(regression)
    return {method: _shares(names, outcomes) for method, names in said.items()}


def _shares(said: dict[str, str], outcomes: Sequence[Outcome]) -> dict[str, Share]:
    """An empty name is that nothing is missing."""
    effects = [o for o in outcomes if o.kind == "effect"]
    return {
        "false alarms": share(bool(said[o.name]) for o in outcomes if o.kind == "none"),
        "traps named as physics": share(bool(said[o.name]) for o in outcomes if o.kind == "trap"),
        "right name alone, d >= 8": share(o.right(said[o.name]) for o in effects if o.d >= PLAIN),
        "spoken names right": share(o.right(said[o.name]) for o in outcomes if said[o.name]),
    }
