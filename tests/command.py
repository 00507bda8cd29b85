"""`warpbrain run` inside the test's own process, where its kernels are loaded already."""

import io
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from warpbrain.cli import main


@dataclass(frozen=True)
class Ran:
    """Exit status and what was printed."""

    status: int
    out: str
    err: str


def warpbrain(*arguments: str | Path) -> Ran:
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as usage:  # argparse's own way out
            status = int(usage.code or 0)
    return Ran(status, out.getvalue(), err.getvalue())


def run(case: str | Path, *arguments: str | Path) -> Ran:
    """`warpbrain run` on the CPU."""
    return warpbrain("run", "--device", "cpu", "--case", case, *arguments)
