"""Starts Warp without its greeting, and without its warning that a machine without a GPU has no GPU driver."""

from __future__ import annotations

import os
import sys
from typing import Any


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
        why = f"kernels cannot be kept there ({error.strerror}): set WARP_CACHE_PATH to a folder that can be written to"
        raise OSError(error.errno, why, error.filename) from None
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(nowhere)
    return wp
