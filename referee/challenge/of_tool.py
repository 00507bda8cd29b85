"""The answers of our tool: what its `diagnosis.json` says, in the table that every code writes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from referee.challenge.answers import Answer
from referee.diagnoses import NOT_PHYSICS, UNKNOWN, Diagnosis, Tried, read_diagnosis
from referee.runs import DIAGNOSIS


def answers_of_tool(cases: Sequence[str], diagnoses: Path) -> list[Answer]:
    """Answers of all cases of which there is a diagnosis; the others have none."""
    files = {case: diagnoses / case / DIAGNOSIS for case in cases}
    return [answer_of(case, read_diagnosis(file)) for case, file in files.items() if file.exists()]


def answer_of(case: str, said: Diagnosis) -> Answer:
    """An answer with the probability that it is right, from the sets of causes that the diagnosis tells."""
    if said.spoken:
        return Answer(case, said.verdict, said.names, said.probability)
    if said.verdict == "group":
        return Answer(case, "group", said.group, _sum(said, lambda tried: bool(tried.causes & set(said.group))))
    right: Callable[[Tried], bool] | None = {
        "nothing missing": lambda tried: not tried.causes,
        "not physics": lambda tried: NOT_PHYSICS in tried.causes and not tried.physics and UNKNOWN not in tried.causes,
        "unknown": lambda tried: UNKNOWN in tried.causes and not tried.physics,
    }.get(said.verdict)
    return Answer(case, said.verdict, (), None if right is None else _sum(said, right))


def _sum(said: Diagnosis, right: Callable[[Tried], bool]) -> float | None:
    if not said.hypotheses:
        return None
    return min(sum(tried.probability for tried in said.hypotheses if right(tried)), 1.0)
