"""How many samples go into a batch: what the memory holds, and no more than pays."""

from __future__ import annotations

import os
from pathlib import Path

from warpbrain.errors import InputError
from warpbrain.kernels.batched.persistent import kept_bytes
from warpbrain.kernels.persistent import blocks_stay
from warpbrain.kernels.tetrahedron import PAIRS
from warpbrain.simulation.system import System

#: Samples beyond which a batch is no faster a sample, by kind of device; docs/ensembles.md has the times. On a CPU a
#: few at a time are as fast as one, and more only take room in its cache.
ENOUGH = {"cpu": 1, "cuda": 256}
#: Part of the free memory that a batch may take.
SHARE = 0.8


def bytes_per_slot(system: System) -> int:
    """Memory that a sample takes in a batch: element results, matrix, vectors and sums."""
    n, m = system.size, system.elements
    elements = m * (len(PAIRS) * 9 + 4 * 3 + 1)
    matrix = len(system.pairs) * 9
    # u, v, dv, both at the start of the step, prescribed velocity, internal forces, b
    vectors = 8 * 3 * n
    if blocks_stay(system.device):
        return system.precision.numpy.itemsize * (elements + matrix + vectors + n) + kept_bytes(n)
    # z, p, q; the preconditioner
    vectors += 3 * 3 * n + 6 * n
    sums = 2 * n
    return system.precision.numpy.itemsize * (elements + matrix + vectors + sums)


def free_bytes(system: System) -> int:
    """Free memory of the device of a system."""
    if system.device.is_cuda:
        return int(system.device.free_memory)
    for line in Path("/proc/meminfo").read_text().splitlines() if Path("/proc/meminfo").exists() else ():
        if line.startswith("MemAvailable:"):
            return 1024 * int(line.split()[1])
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2


def batch_size(system: System, asked: int | None = None) -> int:
    """Samples of a batch: as many as are asked for, or as many as the memory holds and pay; `InputError` if not one."""
    each = bytes_per_slot(system)
    room = int(SHARE * free_bytes(system)) // each
    if room < (asked or 1):
        raise InputError(
            f"--batch {asked or 'auto'}: a sample takes {each / 1e6:.0f} MB, and {system.device.alias} has room for "
            f"{room}"
        )
    return asked or min(room, ENOUGH["cuda" if system.device.is_cuda else "cpu"])
