"""Makes the figures of README and docs: `python docs/make_figures.py`."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

FIGURES = Path(__file__).parent / "figures"
#: Pictures of runs and of cases, by file.
RUNS = {"0529.png": ["--case", "0529"]}
CASES = {"0529-case.png": ["0529"]}


def main() -> None:
    """Run or show each case and keep its picture."""
    FIGURES.mkdir(exist_ok=True)
    for name, arguments in RUNS.items():
        with tempfile.TemporaryDirectory() as folder:
            _warpbrain("run", *arguments, "--out", folder)
            shutil.copy(Path(folder) / "deformation.png", FIGURES / name)
    for name, arguments in CASES.items():
        _warpbrain("cases", "show", *arguments, "--out", str(FIGURES / name))


def _warpbrain(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "warpbrain", *arguments], check=True)


if __name__ == "__main__":
    main()
