"""Makes the figures of README and docs: `python docs/make_figures.py`."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

FIGURES = Path(__file__).parent / "figures"
RUNS = {"0529.png": ["--case", "0529"]}


def main() -> None:
    """Run each case and keep its picture."""
    FIGURES.mkdir(exist_ok=True)
    for name, arguments in RUNS.items():
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, "-m", "warpbrain", "run", *arguments, "--out", folder], check=True)
            shutil.copy(Path(folder) / "deformation.png", FIGURES / name)


if __name__ == "__main__":
    main()
