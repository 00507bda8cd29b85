"""Files of tries as a table."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np


def tries_in(files: Sequence[Path]) -> list[dict[str, Any]]:
    """All tries; of one that stands twice, the later."""
    lines = [json.loads(line) for file in files for line in file.read_text().splitlines()]
    return list({(one["kind"], one["seed"]): one for one in lines}.values())


def table_of(files: Sequence[Path]) -> str:
    """A table in Markdown, a row for each kind."""
    tries = tries_in(files)
    rows = ["| tried | tries | wrong | how it ended | CPU s of one |", "|---|---|---|---|---|"]
    for kind in sorted({one["kind"] for one in tries}):
        some = [one for one in tries if one["kind"] == kind]
        sizes = [one["size"] for one in some if one["size"] is not None]
        ended = "; ".join(f"{count} {how}" for how, count in Counter(one["ended"] for one in some).most_common())
        if sizes:
            ended += f"; they differ by {np.median(sizes):.1e} in the median, {max(sizes):.1e} at most"
        wrong = sum(bool(one["defect"]) for one in some)
        rows.append(f"| {kind} | {len(some):,} | {wrong} | {ended} | {np.mean([one['seconds'] for one in some]):.1f} |")
    return "\n".join(rows)
