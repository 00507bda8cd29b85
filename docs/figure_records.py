"""Which command made each picture of docs/figures, and when: `figures.csv`, written by those commands, and what stands
below each picture on the site."""

from __future__ import annotations

import csv
import datetime
from collections.abc import Iterable
from pathlib import Path

RECORDS = Path(__file__).with_name("figures.csv")


def read_records() -> dict[str, tuple[str, str]]:
    """Command and date (YYYY-MM-DD) by a picture's file name."""
    with RECORDS.open(encoding="utf-8", newline="") as stream:
        return {row["figure"]: (row["command"], row["date"]) for row in csv.DictReader(stream)}


def record(command: str, figures: Iterable[str]) -> None:
    """Write down that a command made these pictures today."""
    made = read_records() | dict.fromkeys(figures, (command, datetime.date.today().isoformat()))
    with RECORDS.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(("figure", "command", "date"))
        writer.writerows((figure, *made[figure]) for figure in sorted(made))
