"""Scores any code's answers by the definitions that the tool is scored by; labels stay sealed until they are fixed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from referee.challenge.answers import Answer, check_commitment, read_answers
from referee.diagnoses import Diagnosis
from referee.errors import InputError
from referee.intervals import Share, share
from referee.outcomes import Outcome
from referee.reliability import reliability
from referee.scores import shares
from referee.sealed import open_labels

#: Of the tool's shares those that need verdict and names alone.
SCORED = (
    "false alarms",
    "traps named as physics",
    "traps said to be unknown physics",
    "rigid motions said to be missing physics",
    "spoken names right",
    "right name alone, d >= 8",
    "right name or group holding it, d >= 8",
    "both of two named",
    "both of two named, each d >= 5",
    "both of two named, each d >= 8",
    "one of two named",
    "unknown found",
    "unknown found, d >= 8",
    "outside the dictionary, called by a wrong name",
)
#: What is said of a case that has no answer.
SILENCE = "cannot say"


def score(
    answers: Path,
    labels: Path,
    *,
    commitment: Path,
    commitments: Path,
    cases: Path | None = None,
    about: str = "",
    of_set: str = "",
) -> dict[str, Any]:
    """Scores of a table of answers.

    Both commitments are checked: that to the answers before any label is opened, that to each label when it is.

    Parameters
    ----------
    answers : Path
        Table of `referee.challenge.answers`.
    labels : Path
        Folder of sealed labels.
    commitment : Path
        The hash of the answers, published before.
    commitments : Path
        The published hashes of the labels.
    cases : Path, optional
        The list of cases that count, one a line; all with a label if not given. A case without an answer counts as
        `SILENCE`.
    about, of_set : str
        Which code and which cases, in words.

    Returns
    -------
    dict

    Raises
    ------
    InputError
        If answers or labels are not those that were committed to, or a case is answered that does not count.
    """
    digest = check_commitment(answers, commitment)
    given = read_answers(answers)
    wanted = None if cases is None else _listed(cases)
    opened = open_labels(labels, commitments, wanted)
    if strange := sorted(set(given) - set(opened)):
        raise InputError(f"{answers}: {', '.join(strange)}: no case of this set")
    outcomes = [outcome_of(label, given.get(name, Answer(name, SILENCE))) for name, label in opened.items()]
    return {
        "answers": answers.stem,
        "about": about,
        "set": of_set,
        "set_sha256": hashlib.sha256("\n".join(sorted(opened)).encode("ascii")).hexdigest(),
        "answers_sha256": digest,
        "cases": len(outcomes),
        "without_answer": sorted(set(opened) - set(given)),
        **scores_of(outcomes),
    }


def outcome_of(label: Mapping[str, Any], answer: Answer) -> Outcome:
    """An answer as the scores take it."""
    group = answer.names if answer.verdict == "group" else ()
    names = () if group else answer.names
    said = Diagnosis(answer.verdict, np.nan, names, answer.probability, group, (), {}, None, {})
    return Outcome(answer.case, label, said)


def scores_of(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Shares, shares of each mechanism, and whether stated probabilities are right as often as they say."""
    scored = shares(outcomes)
    effects = [o for o in outcomes if o.kind == "effect"]
    mechanisms: dict[str, Share] = {
        name: share(o.named for o in effects if o.truth == name) for name in sorted({o.truth for o in effects})
    }
    stated = [(o.said.probability, right(o)) for o in outcomes if o.said.probability is not None]
    p, was = np.array([p for p, _ in stated], dtype=float), np.array([w for _, w in stated], dtype=bool)
    return {
        "shares": {
            "answers right": share(right(o) for o in outcomes).described(),
            **{name: scored[name].described() for name in SCORED},
        },
        "mechanisms": {name: value.described() for name, value in mechanisms.items()},
        "calibration": {
            **reliability(p, was),
            "of": len(p),
            "brier": float(np.mean((p - was) ** 2)) if len(p) else None,
        },
    }


def right(outcome: Outcome) -> bool:
    """Whether an answer is true: all that it names acts, or one of its group; nothing where nothing is missing.

    In a trap nothing, or no physics, is right; outside the dictionary the unknown. `SILENCE` is never right.
    """
    verdict = outcome.said.verdict
    if verdict in ("named", "named + rest", "group"):
        return outcome.held
    if verdict == "unknown":
        return outcome.kind == "outside"
    return (verdict == "nothing missing" and outcome.kind in ("none", "trap")) or (
        verdict == "not physics" and outcome.kind == "trap"
    )


def _listed(file: Path) -> list[str]:
    try:
        return file.read_text(encoding="ascii").split()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: {error}") from None


def write_scores(file: Path, scores: Mapping[str, Any]) -> None:
    """Write scores for the leaderboard."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(scores, indent=1) + "\n", encoding="utf-8")
