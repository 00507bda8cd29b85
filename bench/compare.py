"""Run every code that is installed, three times each, in turn; keep the smallest times; print and record a table."""

from __future__ import annotations

import datetime
import json
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
CODES = {"run_warpbrain.py": None, "run_calculix.py": "ccx", "run_felupe.py": None, "run_scikit_fem.py": None}
REPEATS = 3
COLUMNS = {
    "assembly": "forces + tangent + assembly [ms]",
    "solve": "full static solve [ms]",
    "newton": "Newton",
    "peak_rss_mb": "peak RSS [MB]",
}


def processor() -> str:
    """Name of the processor."""
    for line in Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []:
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor()


def main() -> None:
    """Run, print, record."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    best: dict[str, dict] = {}
    for _ in range(REPEATS):
        for script, program in CODES.items():
            if program is not None and shutil.which(program) is None:
                continue
            run = subprocess.run(
                [sys.executable, str(HERE / script)], capture_output=True, text=True, env=environment, check=False
            )
            if run.returncode != 0:
                print(f"{script}: {(run.stderr or run.stdout).strip().splitlines()[-1]}", file=sys.stderr)
                continue
            row = json.loads(run.stdout.strip().splitlines()[-1])
            kept = best.setdefault(row["code"], row)
            for key in ("assembly", "solve"):
                if key in row:
                    kept[key] = min(kept[key], row[key])
    print(f"{processor()}, {os.cpu_count()} cores, one thread, {datetime.date.today()}\n")
    print("| code | " + " | ".join(COLUMNS.values()) + " | linear solver |")
    print("|---" * (len(COLUMNS) + 2) + "|")
    for row in best.values():
        cells = []
        for key in COLUMNS:
            value = row.get("process_rss_mb" if key == "peak_rss_mb" and "process_rss_mb" in row else key)
            scale = 1000.0 if key in ("assembly", "solve") else 1.0
            cells.append("inside" if value is None else f"{scale * value:.4g}")
        print(f"| {row['code']} {row['version']} | " + " | ".join(cells) + f" | {row['linear_solver']} |")
    record = {"processor": processor(), "date": str(datetime.date.today()), "rows": list(best.values())}
    (HERE / "results").mkdir(exist_ok=True)
    path = HERE / "results" / f"cube_{record['date']}.json"
    path.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
