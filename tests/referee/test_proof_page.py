"""docs/proof.md: every number in its table of runs is that of the scores that are kept."""

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RUNS = ROOT / "bench" / "results" / "proof"
ROWS = [
    [cell.strip() for cell in row.strip("|").split("|")]
    for row in (ROOT / "docs" / "proof.md").read_text(encoding="utf-8").splitlines()
    if row.startswith("| [")
]


def number(cell: str) -> int:
    return int(re.match(r"\[(\d+)\]", cell).group(1))


def test_every_run_has_a_row():
    assert [number(row[0]) for row in ROWS] == sorted(
        int(file.parent.name.removeprefix("run-")) for file in RUNS.glob("run-*/score.json")
    )


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0].partition("]")[0].strip("["))
def test_rows_are_what_was_scored(row):
    run = RUNS / f"run-{number(row[0])}"
    files = [file for file in (run / "score.json", run / "score-traps.json") if file.exists()]
    scores = [json.loads(file.read_text(encoding="utf-8")) for file in files]

    def told(name: str, of: list) -> str:
        return "/".join(str(sum(one["shares"][name][part] for one in of)) for part in ("hits", "of"))

    assert row[4] == " + ".join(str(one["cases"]) for one in scores)
    assert row[5:] == [
        told("false alarms", scores[:1]),
        told("traps named as physics", scores),
        *(told(name, scores[:1]) for name in ("spoken names right", "right name alone, d >= 8")),
        *(told(name, scores[:1]) for name in ("both of two named", "unknown found")),
    ]
