"""What a whole process costs: `python -S bench/process.py COMMAND ...` runs it and prints that as a line of JSON.

A process of its own, as small as can be: Linux counts the memory that a process had before it became another program
as that program's, so that the memory of a small program that a large one starts could not be told.
"""

import json
import os
import subprocess
import sys
import time

_START = [sys.executable, "-S", "-E", os.path.abspath(__file__)]


def whole_process(command, **options):
    """Run a command: what it printed, and its processor and wall time [s], exit status and peak memory [MB]."""
    run = subprocess.run([*_START, *command], capture_output=True, text=True, check=False, **options)
    *printed, told = run.stdout.splitlines()
    return "\n".join(printed), run.stderr, json.loads(told)


def main():
    """Run the arguments as a command."""
    start = time.perf_counter()
    child = os.posix_spawnp(sys.argv[1], sys.argv[1:], os.environ)
    _, status, used = os.wait4(child, 0)
    wall = time.perf_counter() - start
    told = {"seconds": used.ru_utime + used.ru_stime, "wall": wall, "peak_rss_mb": used.ru_maxrss / 1024.0}
    print(json.dumps({"status": os.waitstatus_to_exitcode(status), **told}))


if __name__ == "__main__":
    main()
