"""Starts Warp without its greeting, and without its warning that a machine without a GPU has no GPU driver."""

import os
import sys
from pathlib import Path
from typing import Any

_NOT_KEPT = "kernels cannot be kept there"


def start_warp_quietly() -> Any:
    """Import and initialise Warp; returns the module.

    Its native library writes the driver's warning straight to the descriptor of standard error, which is turned away
    for that moment; an error still comes as an exception.
    """
    import warp as wp

    wp.config.log_level = wp.LOG_WARNING
    sys.stderr.flush()
    saved = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        wp.init()
    except OSError as error:
        # a home that cannot be written to: kernels are compiled into a folder in it
        raise OSError(error.errno, _not_kept(error), error.filename) from None
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(nowhere)
    return wp


def reason_of(error: OSError) -> str:
    """Why the system refused something, and what to do where it is a folder that kernels are kept in."""
    warp = sys.modules.get("warp")
    cache = warp.config.kernel_cache_dir if warp else None
    explained = str(error.strerror).startswith(_NOT_KEPT)
    if cache and error.filename and not explained and Path(os.fsdecode(error.filename)).is_relative_to(cache):
        return _not_kept(error)
    return error.strerror or str(error)


def _not_kept(error: OSError) -> str:
    return f"{_NOT_KEPT} ({error.strerror}): set WARP_CACHE_PATH to a folder that can be written to"
