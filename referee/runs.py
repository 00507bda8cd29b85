"""What is kept beside what the tool said: the list of its runs, and how much effects stand out for it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

#: The list of runs, in the folder of results.
RUNS = "runs.csv"
COLUMNS = ("case", "status", "seconds", "version", "commit", "arguments", "left_out")
#: What the tool writes into the folder of a case.
DIAGNOSIS = "diagnosis.json"
#: How much what acts stands out for the tool, by case; written by `referee.seen_by_tool`.
SEEN = "detectability.json"


def read_runs(out: Path) -> list[dict[str, str]]:
    """Rows of the list of runs; none if there is no list."""
    file = out / RUNS
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


def read_seen(diagnoses: Path) -> dict[str, list[float]]:
    """What was written, also by runs that told `d` of all alone; nothing if nothing was."""
    file = diagnoses / SEEN
    content = json.loads(file.read_text(encoding="ascii")) if file.exists() else {}
    return {name: value if isinstance(value, list) else [value] for name, value in content.items()}
