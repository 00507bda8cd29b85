"""The list of runs of the tool beside what it said."""

from __future__ import annotations

import csv
from pathlib import Path

#: The list of runs, in the folder of results.
RUNS = "runs.csv"
COLUMNS = ("case", "status", "seconds", "version", "commit", "arguments", "left_out")
#: What the tool writes into the folder of a case.
DIAGNOSIS = "diagnosis.json"


def read_runs(out: Path) -> list[dict[str, str]]:
    """Rows of the list of runs; none if there is no list."""
    file = out / RUNS
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as lines:
        return list(csv.DictReader(lines))
