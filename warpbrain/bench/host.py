"""On what machine, when, and beside how much other work something was measured: what a recorded time must say."""

from __future__ import annotations

import os
import platform
from datetime import date
from pathlib import Path
from typing import Any


def host() -> dict[str, Any]:
    """Processor, its hardware threads, processes that ran or waited in the last minute (-1: not known), and the day."""
    return {
        "processor": processor(),
        "hardware_threads": os.cpu_count() or 1,
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else -1.0,
        "date": date.today().isoformat(),
    }


def processor() -> str:
    """Name of the processor, as far as the system tells it."""
    told = Path("/proc/cpuinfo")
    lines = told.read_text(encoding="utf-8").splitlines() if told.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return next(iter(names), platform.processor() or "CPU")
