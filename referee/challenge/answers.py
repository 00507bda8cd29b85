"""Answers of a code: a table of one row a case, and the hash by which it is committed to before labels are opened."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from referee.diagnoses import ALARMS, NAMING, VERDICTS
from referee.errors import InputError

COLUMNS = ("case", "verdict", "names", "probability")
#: What stands between names.
BETWEEN = ";"
#: Of the file of a commitment, behind the name of that of the answers.
COMMITMENT = ".sha256"


@dataclass(frozen=True)
class Answer:
    """What a code says of a case.

    Attributes
    ----------
    case : str
    verdict : str
        One of `referee.diagnoses.VERDICTS`.
    names : tuple of str
        All that act, if it is "named" or "named + rest"; of which one acts, if it is "group"; else nothing.
    probability : float or None
        That the answer is right.
    """

    case: str
    verdict: str
    names: tuple[str, ...] = ()
    probability: float | None = None

    @property
    def alarm(self) -> bool:
        """Whether it claims that physics is missing."""
        return self.verdict in ALARMS


def write_answers(file: Path, answers: Sequence[Answer]) -> None:
    """Write a table of answers."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for one in answers:
            stated = "" if one.probability is None else f"{one.probability:.4g}"
            writer.writerow((one.case, one.verdict, BETWEEN.join(one.names), stated))


def read_answers(file: Path) -> dict[str, Answer]:
    """Answers by case.

    Raises
    ------
    InputError
        If the table cannot be read, a verdict is not one, names are missing or too many, a probability is not one, or a
        case has two answers.
    """
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream)
            if tuple(reader.fieldnames or ()) != COLUMNS:
                raise InputError(f"{file}: columns {', '.join(reader.fieldnames or ())}; expected {', '.join(COLUMNS)}")
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: {error}") from None
    answers: dict[str, Answer] = {}
    for number, row in enumerate(rows, start=2):
        answer = _answer(f"{file}: line {number}", row)
        if answer.case in answers:
            raise InputError(f"{file}: line {number}: '{answer.case}' has an answer already")
        answers[answer.case] = answer
    return answers


def _answer(where: str, row: Mapping[str, str | None]) -> Answer:
    case, verdict, names, stated = ((row[name] or "").strip() for name in COLUMNS)
    verdict = " + ".join(part.strip() for part in verdict.lower().split("+"))
    if verdict not in VERDICTS:
        raise InputError(f"{where}: verdict '{verdict}'; expected one of {', '.join(VERDICTS)}")
    named = tuple(name.strip() for name in names.split(BETWEEN) if name.strip())
    if (verdict in NAMING) != bool(named):
        raise InputError(f"{where}: '{verdict}' with {len(named)} names; {', '.join(NAMING)} have names, others none")
    try:
        probability = float(stated) if stated else None
    except ValueError:
        raise InputError(f"{where}: probability '{stated}'; expected a number") from None
    if probability is not None and not 0.0 <= probability <= 1.0:
        raise InputError(f"{where}: probability {stated}; expected 0 to 1")
    return Answer(case, verdict, named, probability)


def commit(answers: Path) -> str:
    """Write the hash of a table of answers beside it, which is published before labels are opened; returns it."""
    read_answers(answers)
    digest = _hash(answers)
    answers.with_name(answers.name + COMMITMENT).write_text(f"{digest}  {answers.name}\n", encoding="ascii")
    return digest


def check_commitment(answers: Path, commitment: Path) -> str:
    """The hash of answers that were committed to.

    Raises
    ------
    InputError
        If there is no commitment, or the answers are others than those that it is of.
    """
    try:
        published = commitment.read_text(encoding="ascii").split()[0]
    except (OSError, UnicodeDecodeError, IndexError):
        raise InputError(f"{commitment}: no commitment to {answers.name}; first: challenge commit {answers}") from None
    digest = _hash(answers)
    if digest != published:
        raise InputError(f"{answers}: its hash is {digest}, {commitment} says {published}")
    return digest


def _hash(file: Path) -> str:
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{file}: {error}") from None
