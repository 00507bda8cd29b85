"""Cost against size, 3k to 1M tetrahedra: an equilibrium of the cube by every code that is installed, a step of ours.

`python bench/growth.py` measures (one thread; some minutes), writes `results/growth_DATE.json` and draws
`docs/figures/growth.png`. What takes longer than the limit is said to.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from process import whole_process

from warpbrain.bench.command import host

HERE = Path(__file__).parent
FIGURES = HERE.parent / "docs" / "figures"
#: Cells along an edge of the cube, six tetrahedra each.
CELLS = (8, 12, 20, 32, 55)
#: Scripts with their arguments, and what has to be there.
CODES = {("run_warpbrain.py", "steps"): None, ("run_calculix.py",): "ccx", ("run_felupe.py",): "felupe"}


def main() -> None:
    """Run, record, draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--limit", type=float, default=300.0, help="seconds of one process (default: 300)")
    parser.add_argument("--out", type=Path, default=HERE / "results", help="folder for growth_DATE.json")
    options = parser.parse_args()
    where, rows = host(), []
    for command, needed in CODES.items():
        if not (needed is None or shutil.which(needed) or importlib.util.find_spec(needed)):
            print(f"{' '.join(command)}: {needed} is not installed", file=sys.stderr)
            continue
        for cells in CELLS:
            rows.append(run([*command], cells, options.limit))
            print(json.dumps(rows[-1]), flush=True)
            if "failed" in rows[-1]:
                break
    path = options.out / f"growth_{where['date']}.json"
    path.write_text(
        json.dumps({"host": where, "limit": options.limit, "rows": rows}, indent=1) + "\n", encoding="utf-8"
    )
    draw(rows, FIGURES / "growth.png")
    print(f"written to {path}")


def run(command: list[str], cells: int, limit: float) -> dict[str, Any]:
    """What a code reports of a size, with time and memory of its whole process; why it failed, if it did."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    size = {"script": command[0], "cells": cells, "tetrahedra": 6 * cells**3}
    environment = {**os.environ, **threads, "CUBE_CELLS": str(cells)}
    begun = ["timeout", f"{limit:g}", sys.executable, str(HERE / command[0]), *command[1:]]
    try:
        printed, failed, used = whole_process(begun, env=environment)
    except subprocess.SubprocessError as error:
        return {**size, "failed": str(error)}
    if used["status"] == 124:
        return {**size, "failed": f"over {limit:g} s"}
    if used["status"] != 0:
        return {**size, "failed": (failed or printed).strip().splitlines()[-1][:200]}
    row = json.loads(printed.splitlines()[-1])
    whole = {"process": used["seconds"], "wall": used["wall"], "peak_rss_mb": used["peak_rss_mb"]}
    return {**size, **row, **{name: value for name, value in whole.items() if name not in row}}


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Processor time of an equilibrium and of a step, and peak memory, over the number of tetrahedra."""
    import matplotlib.pyplot as plt

    figure, (times, memory) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
    solved = [row for row in rows if "failed" not in row]
    for code in dict.fromkeys(row["code"] for row in solved):
        own = [row for row in solved if row["code"] == code]
        sizes = [row["tetrahedra"] for row in own]
        [line] = times.loglog(sizes, [row["setup"] + row["solve"] for row in own], "o-", label=f"{code}, equilibrium")
        memory.loglog(sizes, [row["peak_rss_mb"] for row in own], "o-", color=line.get_color(), label=code)
        if "step" in own[0]:
            times.loglog(
                sizes, [row["step"] for row in own], "s--", color=line.get_color(), label=f"{code}, step of 1 ms"
            )
    for axes, what in ((times, "processor time [s], one thread"), (memory, "peak memory of the process [MB]")):
        axes.set(xlabel="tetrahedra", ylabel=what)
        axes.grid(alpha=0.3)
        axes.legend()
    figure.savefig(path, dpi=120)
    sys.path.insert(0, str(FIGURES.parent))
    from figure_records import record

    record("python bench/growth.py", [path.name])


if __name__ == "__main__":
    main()
