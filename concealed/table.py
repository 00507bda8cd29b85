"""What is published of the stand-ins, as the table of docs/stand-ins.md: ``python -m concealed.table``.

Reads `case.toml` and recordings, and no truth.
"""

from __future__ import annotations

import tomllib

import numpy as np

from concealed.observing import WALLS, rms
from concealed.places import CASES, published_hash
from concealed.publish import read_recording
from concealed.published import NAMES
from warpbrain.cases.building.pipeline import RECIPES

HEAD = ("case", "side", "points: ventricles / cavity", "fluid level, mm", "ventricles, mm", "cavity, mm", "hash")


def rows() -> list[str]:
    """Lines of the table, in Markdown."""
    cells: list[tuple[str, ...]] = [HEAD, ("---",) * len(HEAD)]
    motions = []
    for name in NAMES:
        case = tomllib.loads((CASES / name / "case.toml").read_text(encoding="utf-8"))
        level = next(entry["csf_level"] for entry in case["mechanism"] if entry["kind"] == "gravity")
        walls = [read_recording(CASES / name / "recordings" / f"{wall}.csv")[1] for wall in WALLS]
        moved = [1e3 * rms(wall) for wall in walls]
        motions.append(moved)
        counts = " / ".join(str(len(wall)) for wall in walls)
        side, digits = str(RECIPES[name].resection), published_hash(name)[:12]
        cells.append((name, side, counts, f"{level:g}", f"{moved[0]:.2f}", f"{moved[1]:.2f}", f"`{digits}`"))
    ventricles, cavity = np.median(motions, axis=0)
    cells.append(("median", "", "", "", f"{ventricles:.2f}", f"{cavity:.2f}", ""))
    return ["| " + " | ".join(row) + " |" for row in cells]


if __name__ == "__main__":
    print("\n".join(rows()))
