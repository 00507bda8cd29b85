"""Run every code that is installed, three times each, in turn; keep the smallest times, print and record them.

`python bench/compare.py` measures; `python docs/make_benchmarks.py` makes the tables of `docs/benchmarks.md`.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from process import whole_process

from warpbrain.bench.command import host

HERE = Path(__file__).parent
REPEATS = 3
#: Scripts with their arguments, and what has to be there: a program or a module.
CODES = {
    ("run_warpbrain.py",): None,
    ("run_calculix.py",): "ccx",
    ("run_felupe.py",): "felupe",
    ("run_felupe.py", "pardiso"): "pypardiso",
    ("run_scikit_fem.py",): "skfem",
    ("run_scikit_fem.py", "pardiso"): "pypardiso",
}
#: Times [s] of a process that solves once, and of one that also does things again; the smallest of each is kept.
ONCE, AGAIN = ("setup", "solve", "together", "process"), ("assembly", "setup_again", "solve_again")


def main() -> None:
    """Run, record, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=REPEATS, help=f"processes of each kind (default: {REPEATS})")
    parser.add_argument("--out", type=Path, default=HERE / "results", help="folder for cube_DATE.json")
    options = parser.parse_args()
    environment, where = one_thread(), host()
    rows: dict[tuple[str, ...], dict[str, Any]] = {}
    for _ in range(options.repeats):
        for command, needed in CODES.items():
            if not is_there(command, needed):
                continue
            try:
                row = run([*command], environment)
                keep(rows.setdefault(command, row), row, ONCE)
                if needed != "ccx":
                    keep(rows[command], run([*command, "assembly"], environment), AGAIN)
            except Failed as error:
                sys.exit(f"{' '.join(command)}: {error}")
    path = options.out / f"cube_{where['date']}.json"
    path.write_text(json.dumps({"host": where, "rows": list(rows.values())}, indent=1) + "\n", encoding="utf-8")
    for row in rows.values():
        told = ", ".join(f"{name} {1000.0 * row[name]:.4g} ms" for name in (*ONCE, *AGAIN) if name in row)
        print(f"{row['code']} {row['version']}, {row['linear_solver']}: {told}; {row['newton']} iterations")
    print(f"written to {path}")


def one_thread() -> dict[str, str]:
    """This environment, in which codes have one thread."""
    return {**os.environ, **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")}


def is_there(command: tuple[str, ...], needed: str | None) -> bool:
    """Whether the program or module that a script needs is installed; says so if it is not."""
    if needed is None or shutil.which(needed) or importlib.util.find_spec(needed):
        return True
    print(f"{' '.join(command)}: {needed} is not installed", file=sys.stderr)
    return False


def run(command: list[str], environment: dict[str, str], before: Sequence[str] = ()) -> dict[str, Any]:
    """The row that a script reports, with what its whole process took if it has none to report itself.

    `before`: a program with arguments that runs it. `Failed` if the process ends with another status than 0.
    """
    printed, failed, used = whole_process(
        [*before, sys.executable, str(HERE / command[0]), *command[1:]], env=environment
    )
    if used["status"] != 0:
        said = (failed or printed).strip().splitlines()
        raise Failed(used["status"], said[-1] if said else "")
    row = json.loads(printed.splitlines()[-1])
    whole = {"process": used["seconds"], "wall": used["wall"], "peak_rss_mb": used["peak_rss_mb"]}
    return {**whole, **row, "together": row["setup"] + row["solve"]}


class Failed(Exception):
    """A process ended with a `status` other than 0, and said something last."""

    def __init__(self, status: int, said: str) -> None:
        super().__init__(said)
        self.status = status


def keep(kept: dict[str, Any], row: dict[str, Any], names: tuple[str, ...]) -> None:
    """Keep the smaller one of each time of these names."""
    for name in names:
        if name in row:
            kept[name] = min(kept.get(name, row[name]), row[name])


if __name__ == "__main__":
    main()
