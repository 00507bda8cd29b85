"""The leaderboard page, from the scores of all codes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from referee.errors import InputError
from referee.intervals import Share

Scores = Mapping[str, Any]

#: Columns of the first table: share and its heading.
HEADINGS = {
    "answers right": "answers right",
    "false alarms": "false alarms",
    "traps named as physics": "traps named",
    "spoken names right": "spoken names right",
    "right name alone, d >= 8": "right name alone, d >= 8",
    "both of two named": "both of two",
    "one of two named": "one of two",
    "unknown found": "unknown found, d >= 5",
}


def leaderboard(results: Path) -> str:
    """The page of all scores in a folder, a section for each set of cases.

    Raises
    ------
    InputError
        If there are none, or a file holds none.
    """
    sets: dict[str, list[Scores]] = {}
    for file in sorted(results.glob("*/*.json")):
        try:
            scores = json.loads(file.read_text(encoding="utf-8"))
            sets.setdefault(scores["set_sha256"], []).append(scores)
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{file}: no scores: {error}") from None
    if not sets:
        raise InputError(f"{results}: no scores in folders of it")
    lines = [
        "# Leaderboard",
        "",
        "Made by `python -m referee challenge leaderboard`; docs/challenge.md says how to take part, what the scores",
        "mean and what is unfair. Shares with intervals of Clopper and Pearson (95 %). A case without an answer counts",
        "as `cannot say`. Sorted by answers that are right.",
    ]
    for rows in sets.values():
        lines += ["", *_section(sorted(rows, key=lambda row: (-_share(row, "answers right").hits, row["answers"])))]
    return "\n".join(lines) + "\n"


def _section(rows: Sequence[Scores]) -> list[str]:
    first = rows[0]
    lines = [f"## {first['set'] or 'A set'}", "", f"{first['cases']} cases.", ""]
    lines += [f"| code | {' | '.join(HEADINGS.values())} | without an answer |", "|---" * (len(HEADINGS) + 2) + "|"]
    for row in rows:
        cells = " | ".join(_in_words(_share(row, name)) for name in HEADINGS)
        lines.append(f"| {row['answers']} | {cells} | {len(row['without_answer'])} |")
    names = sorted({name for row in rows for name in row["mechanisms"]})
    lines += [
        "",
        "Right name alone, whatever `d`:",
        "",
        f"| code | {' | '.join(names)} |",
        "|---" * (len(names) + 1) + "|",
    ]
    for row in rows:
        counts = [row["mechanisms"].get(name, {"hits": 0, "of": 0}) for name in names]
        cells = " | ".join(f"{count['hits']} of {count['of']}" for count in counts)
        lines.append(f"| {row['answers']} | {cells} |")
    lines += ["", "Stated probabilities that the answer is right:", ""]
    lines += ["| code | stated | calibration error | Brier score | stated: right, of |", "|---" * 5 + "|"]
    for row in rows:
        known = row["calibration"]
        if not known["of"]:
            lines.append(f"| {row['answers']} | 0 | - | - | |")
            continue
        bins = "; ".join(f"{p:.2f}: {share:.2f}, {count}" for p, share, count in known["rows"])
        lines.append(f"| {row['answers']} | {known['of']} | {known['ece']:.3f} | {known['brier']:.3f} | {bins} |")
    lines += ["", "| code | what it is | SHA-256 of its answers |", "|---" * 3 + "|"]
    lines += [f"| {row['answers']} | {row['about']} | `{row['answers_sha256'][:16]}` |" for row in rows]
    return lines


def _share(row: Scores, name: str) -> Share:
    counts = row["shares"][name]
    return Share(counts["hits"], counts["of"])


def _in_words(value: Share) -> str:
    if not value.of:
        return "0 of 0"
    low, high = value.interval
    return f"{value.hits} of {value.of} ({100 * low:.0f} to {100 * high:.0f} %)"
