"""`warpbrain run` inside the test's own process, where its kernels are loaded already."""

import io
import math
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from warpbrain.cli import main


@dataclass(frozen=True)
class Ran:
    """Exit status and what was printed."""

    status: int
    out: str
    err: str


def warpbrain(*arguments: str | Path) -> Ran:
    out, err = io.StringIO(), io.StringIO()
    # on a busy machine any test may take long enough for a line of progress
    with redirect_stdout(out), redirect_stderr(err), patch("warpbrain.terminal.progress.EVERY", math.inf):
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as usage:  # argparse's own way out
            status = int(usage.code or 0)
    return Ran(status, out.getvalue(), err.getvalue())


def run(case: str | Path, *arguments: str | Path) -> Ran:
    """`warpbrain run` on the CPU."""
    return warpbrain("run", "--device", "cpu", "--case", case, *arguments)
