"""A command that is killed while it compiles kernels for the first time leaves a cache that the next one can use."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from folders import write_folder

#: Of the package and of `not_drawn`.
PLACES = os.pathsep.join(map(str, (Path(__file__).parents[2], Path(__file__).parents[1])))
#: Ends a process at its `count`-th operation of a kind on the cache, or, in the compiler itself, after 0.1 s more of
#: computing: a busy machine does not change the moment. Kernels are compiled before anything is written to `--out`.
RUN = """
import os, signal, sys
event, count, within = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
seen = 0

def watch(name, arguments):
    global seen
    if name != event or "_p%d_t" % os.getpid() not in str(arguments[0]) or event == "open" and arguments[1] != "w":
        return
    seen += 1
    if seen == count:
        signal.setitimer(signal.ITIMER_VIRTUAL, within) if within else os.kill(os.getpid(), signal.SIGKILL)

sys.addaudithook(watch)
from not_drawn import main, nothing_drawn
with nothing_drawn():
    sys.exit(main(["run", "--device", "cpu", "--case", "case", "--out", sys.argv[4], "--quiet"]))
"""


@pytest.mark.slow(30)
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_killed_while_kernels_are_compiled(tmp_path):
    write_folder(tmp_path / "case")
    variables = {**os.environ, "PYTHONPATH": PLACES, "WARP_CACHE_PATH": str(tmp_path / "cache")}

    def run(*arguments):
        command = [sys.executable, "-c", RUN, *arguments]
        return subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True, check=False)

    # all of them die over one cache: the compiler is at work, a source is begun, a kernel is whole but not in its place
    for event, count, within, by in (
        ("open", 1, 0.1, signal.SIGVTALRM),
        ("open", 3, 0.0, signal.SIGKILL),
        ("os.rename", 2, 0.0, signal.SIGKILL),
    ):
        killed = run(event, f"{count}", f"{within}", "killed")
        assert killed.returncode == -by, killed.stderr
        assert not list((tmp_path / "killed").glob("*"))
        # it did die in the middle
        assert list((tmp_path / "cache").glob("*/*_p*_t*"))
    again = run("none", "0", "0", "again")
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "again" / "result.vtu").exists()
