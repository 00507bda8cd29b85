"""CuPy on a GPU: whether it works, and whether there is memory; and what is kept from state to state."""

from __future__ import annotations

from functools import cache
from typing import Any

from warpbrain.simulation.factored import KeptFactors


def has_cupy(device: Any) -> bool:
    """Whether a Warp device is a GPU for which CuPy is installed, and finds the libraries that it calls."""
    return bool(device.is_cuda) and _works()


@cache
def _works() -> bool:
    try:
        import cupy
        import cupyx.scipy.linalg  # noqa: F401

        cupy.linalg.cholesky(cupy.eye(2))
    except Exception:
        # whatever keeps an extra from working is no reason to stop: the same is done without it
        return False
    return True


def require_memory(device: Any, needed: int) -> None:
    """Raise `MemoryError` if a GPU has fewer bytes than these that are free, or that CuPy holds and does not use."""
    import cupy

    with cupy.cuda.Device(device.ordinal) as gpu:
        pool = cupy.get_default_memory_pool()
        free = gpu.mem_info[0] + pool.total_bytes() - pool.used_bytes()
    if needed > free:
        raise MemoryError(f"{needed / 1e9:.1f} GB of memory of {device.alias} are needed, {free / 1e9:.1f} GB are free")


def kept_for(device: Any) -> KeptFactors:
    """What is kept where states are solved on a Warp device: it serves terms with unknowns of their own alone."""
    return KeptFactors()
