"""What well-known methods make of the cases that the tool is scored by."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from referee.baselines import METHODS, answers_of
from referee.challenge.answers import Answer
from referee.challenge.export import neutral_case
from referee.challenge.score import outcome_of
from referee.intervals import Share
from referee.outcomes import Outcome
from referee.scores import shares
from referee.threads import mapped
from warpbrain.cases.reading import read_case

#: Shares that are compared.
COMPARED = (
    "false alarms",
    "traps named as physics",
    "right name alone, d >= 8",
    "right name alone, the old d >= 8",
    "spoken names right",
)


def compare(folders: Sequence[Path], outcomes: Sequence[Outcome]) -> dict[str, dict[str, Share]]:
    """Shares of each method, under the names of the tool's; `folders`: of the case of each outcome."""
    with mapped(os.cpu_count() or 1) as each:
        said = list(each(_answers, folders))
    by_method = {}
    for method in METHODS:
        given = [outcome_of(o.label, answers[method]) for o, answers in zip(outcomes, said, strict=True)]
        scored = shares(given)
        by_method[method] = {name: scored[name] for name in COMPARED}
    return by_method


def _answers(case: Path) -> dict[str, Answer]:
    return answers_of(neutral_case(read_case(case)))
