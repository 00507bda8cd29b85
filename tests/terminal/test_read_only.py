"""A home and a cache of kernels on a disk that cannot be written to."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command import run
from folders import write_folder

#: Of the package and of `not_drawn`.
PLACES = os.pathsep.join(map(str, (Path(__file__).parents[2], Path(__file__).parents[1])))
CURE = "kernels cannot be kept there ({}): set WARP_CACHE_PATH to a folder that can be written to\n"


@pytest.fixture(scope="module")
def cache():
    """Where the kernels of this process are kept."""
    import warp as wp

    wp.init()
    return Path(wp.config.kernel_cache_dir)


def run_where(folder, read_only, **environment):
    """`warpbrain run`, undrawn, in a process that sees a folder as read-only; its status and standard error."""
    command = [sys.executable, "-m", "not_drawn", "run", "--device", "cpu", "--case", "case", "--out", "out", "--quiet"]
    if read_only is not None:
        script = f"mount --bind '{read_only}' '{read_only}' && mount -o remount,ro,bind '{read_only}' && exec \"$@\""
        unshare = ["unshare", *([] if os.geteuid() == 0 else ["-r"]), "-m", "sh", "-c"]
        if shutil.which("unshare") is None or subprocess.run([*unshare, script, "sh", "true"], check=False).returncode:
            pytest.skip("this system lets nobody see a folder as read-only")
        command = [*unshare, script, "sh", *command]
    write_folder(folder / "case")
    given = {**os.environ, "PYTHONPATH": PLACES, **environment}
    variables = {name: value for name, value in given.items() if value}
    ran = subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True, check=False)
    lines = [line for line in ran.stderr.splitlines(keepends=True) if not line.startswith("Warp CUDA warning")]
    return ran.returncode, "".join(lines)


@pytest.mark.slow(7)
@pytest.mark.usefixtures("undrawn")
def test_a_cache_that_has_all_kernels_is_enough(tmp_path, cache):
    # where this machine has not yet compiled them
    assert run(write_folder(tmp_path / "case"), "--out", tmp_path / "before").status == 0
    assert run_where(tmp_path, cache, WARP_CACHE_PATH=str(cache.parent)) == (0, "")
    assert (tmp_path / "out" / "result.vtu").exists()


@pytest.mark.parametrize("begun", [False, pytest.param(True, marks=pytest.mark.slow(2))])
def test_a_cache_without_kernels(tmp_path, cache, begun):
    empty = tmp_path / "cache"
    (empty / cache.name if begun else empty).mkdir(parents=True)
    status, said = run_where(tmp_path, empty, WARP_CACHE_PATH=str(empty))
    assert status == 1
    assert said.startswith(f"warpbrain: {empty}/{cache.name}")
    assert said.endswith(CURE.format("Read-only file system"))
    assert said.count("\n") == 1 and not (tmp_path / "out" / "result.vtu").exists()


@pytest.mark.slow(4)
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder that nobody can make")
def test_a_home_that_is_not_there(tmp_path):
    status, said = run_where(tmp_path, None, HOME="/proc/none", XDG_CACHE_HOME="", WARP_CACHE_PATH="")
    assert (status, said) == (1, "warpbrain: /proc/none: " + CURE.format("No such file or directory"))
