"""Cost against size, 3k to 1M tetrahedra: an equilibrium of the cube by every code that is installed, a step of ours.

`python bench/growth.py` measures (one thread, and a GPU if there is one), writes `results/growth_DATE.json`
and draws `docs/figures/growth.png`. A code that takes longer than the limit is listed as such, and is not asked for
larger sizes. `--draw` draws what several machines measured: a code is taken from the first file that has it.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from compare import HERE, Failed, is_there, one_thread, run

from warpbrain.bench.command import host

FIGURES = HERE.parent / "docs" / "figures"
#: Cells along an edge of the cube, six tetrahedra each.
CELLS = (8, 12, 20, 32, 55)
#: Scripts with their arguments, and what has to be there.
CODES = {
    ("run_warpbrain.py", "steps"): None,
    ("run_warpbrain.py", "steps", "gpu", "assembly"): "nvidia-smi",
    ("run_calculix.py",): "ccx",
    ("run_felupe.py",): "felupe",
}


def main() -> None:
    """Run, record, draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--limit", type=float, default=300.0, help="seconds of one process (default: 300)")
    parser.add_argument("--out", type=Path, default=HERE / "results", help="folder for growth_DATE.json")
    parser.add_argument("--draw", type=Path, nargs="+", metavar="FILE", help="measure nothing, draw these files")
    options = parser.parse_args()
    if options.draw:
        draw([json.loads(path.read_text(encoding="utf-8"))["rows"] for path in options.draw], FIGURES / "growth.png")
        return
    where, rows = host(), []
    for command, needed in CODES.items():
        if not is_there(command, needed):
            continue
        for cells in CELLS:
            rows.append(row_of([*command], cells, options.limit))
            print(json.dumps(rows[-1]), flush=True)
            if "failed" in rows[-1]:
                break
    path = options.out / f"growth_{where['date']}.json"
    path.write_text(
        json.dumps({"host": where, "limit": options.limit, "rows": rows}, indent=1) + "\n", encoding="utf-8"
    )
    draw([rows], FIGURES / "growth.png")
    print(f"written to {path}")


def row_of(command: list[str], cells: int, limit: float) -> dict[str, Any]:
    """What a code reports of a size, and `failed`, why it has none, if it took longer than a limit [s] or ended."""
    size = {"script": command[0], "cells": cells, "tetrahedra": 6 * cells**3}
    try:
        return size | run(command, {**one_thread(), "CUBE_CELLS": str(cells)}, ("timeout", f"{limit:g}"))
    except Failed as error:
        # the status with which `timeout` ends what it stops
        return {**size, "failed": f"over {limit:g} s" if error.status == 124 else str(error)}


def draw(measured: list[list[dict[str, Any]]], path: Path) -> None:
    """Time of an equilibrium and of a step, and peak memory, over the number of tetrahedra; `measured` by machines."""
    import matplotlib.pyplot as plt

    figure, (times, memory) = plt.subplots(1, 2, figsize=(11.0, 5.6), layout="constrained")
    by_code: dict[str, list[dict[str, Any]]] = {}
    for rows in measured:
        solved = [row for row in rows if "failed" not in row]
        for code in dict.fromkeys(row["code"] for row in solved):
            by_code.setdefault(code, [row for row in solved if row["code"] == code])
    for code, own in by_code.items():
        sizes = [row["tetrahedra"] for row in own]
        # of a GPU with its kernels loaded, which a process that solves once waits for
        equilibria = [row.get("setup_again", row["setup"]) + row.get("solve_again", row["solve"]) for row in own]
        [line] = times.loglog(sizes, equilibria, "o-", label=f"{code}, equilibrium")
        device = "device_mb" in own[0]
        held = [row["device_mb" if device else "peak_rss_mb"] for row in own]
        memory.loglog(sizes, held, "o-", color=line.get_color(), label=f"{code}, of the device" if device else code)
        if "step" in own[0]:
            times.loglog(
                sizes, [row["step"] for row in own], "s--", color=line.get_color(), label=f"{code}, step of 1 ms"
            )
    for axes, what in ((times, "processor time of one thread, wall time of a GPU [s]"), (memory, "peak memory [MB]")):
        axes.set(xlabel="tetrahedra", ylabel=what)
        axes.grid(alpha=0.3)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), fontsize="small")
    figure.savefig(path, dpi=120)
    sys.path.insert(0, str(FIGURES.parent))
    from figure_records import record

    record("python bench/growth.py", [path.name])


if __name__ == "__main__":
    main()
