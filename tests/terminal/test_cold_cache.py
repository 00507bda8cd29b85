"""A command that is killed while it compiles kernels for the first time leaves a cache that the next one can use."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from folders import write_folder

ROOT = Path(__file__).parents[2]
#: Ends a process as SIGKILL does after so many seconds of computing: a busy machine does not change the moment.
RUN = """
import signal, sys
if float(sys.argv[1]):
    signal.setitimer(signal.ITIMER_VIRTUAL, float(sys.argv[1]))
from warpbrain.cli import main
sys.exit(main(["run", "--device", "cpu", "--case", "case", "--out", sys.argv[2], "--quiet"]))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("seconds", [2.0, 3.5, 5.0, 6.5])
def test_killed_while_kernels_are_compiled(tmp_path, seconds):
    write_folder(tmp_path / "case")
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "WARP_CACHE_PATH": str(tmp_path / "cache")}

    def run(limit, out):
        command = [sys.executable, "-c", RUN, str(limit), out]
        return subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True, check=False)

    killed = run(seconds, "killed")
    # on a fast machine it may have ended before
    assert killed.returncode in (0, -signal.SIGVTALRM), killed.stderr
    again = run(0.0, "again")
    assert again.returncode == 0, again.stderr
    assert not (tmp_path / "killed" / "summary.json").exists() or killed.returncode == 0
    assert (tmp_path / "again" / "result.vtu").exists()
