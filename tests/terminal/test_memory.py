"""Memory that is kept is not cleared again by the system, page by page."""

import platform
import subprocess
import sys

import pytest

#: Pages that the system clears while arrays of 40 MB are made and freed, 20 of them, after the first.
PROGRAM = """
import resource
import numpy as np
from warpbrain.terminal.memory import keep_freed_memory

keep_freed_memory()
for number in range(21):
    np.ones(5_000_000)
    if number == 0:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library does as it likes")
def test_an_array_is_where_another_one_was():
    """All of them have fewer new pages than one has, of 4 kB or of 2 MB each."""
    asked = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert int(asked.stdout) < 20
