"""What the commands of the bench share: checks, the machine that a recorded time must name, and its file."""

import argparse
import json
import math
import os
import platform
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from warpbrain.errors import InputError


def chosen(option: str, text: str | None, known: Sequence[str]) -> list[str]:
    """Names of a list with commas; all that are known if there is none."""
    names = list(known) if text is None else text.split(",")
    for name in names:
        if name not in known:
            raise InputError(f"{option} {name}: expected some of {', '.join(known)}")
    return names


def numbers(option: str, text: str, most: float = math.inf) -> list[int]:
    """Whole numbers of a list with commas, from 1 to `most`."""
    words = text.split(",")
    if not all(word.strip().isdecimal() and 0 < int(word) <= most for word in words):
        upwards = "of at least 1" if most == math.inf else f"from 1 to {most}"
        raise InputError(f"{option} {text}: expected whole numbers {upwards}, with commas between them")
    return [int(word) for word in words]


def write(path: Path | None, measured: Any) -> None:
    """Write what was measured as JSON, whole, and say so; if a path is given."""
    from warpbrain.atomic import whole_file

    if path is not None:
        with whole_file(path) as scratch:
            scratch.write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")
        print(f"written to {path}")


def say(macro: str, *values: Any) -> None:
    """Print what a macro of `bench.txt` makes of values, at once."""
    from warpbrain.report.page import lines

    print(*lines("bench.txt", macro, *values), sep="\n", flush=True)


def start(options: argparse.Namespace) -> dict[str, str]:
    """Check that a file or folder for what is measured can be written, and start Warp; returns the versions."""
    from warpbrain.atomic import check_writable, output_folder
    from warpbrain.report.summary import machine
    from warpbrain.terminal.quiet import start_warp_quietly

    if getattr(options, "json", None) is not None:
        check_writable(options.json)
    if getattr(options, "out", None) is not None:
        output_folder(options.out)
    start_warp_quietly()
    return machine()


def release(versions: Mapping[str, str]) -> str:
    """Versions of this package and Warp, as printed."""
    return f"warpbrain {versions['warpbrain']}, Warp {versions['warp-lang']}"


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
    listed = Path("/proc/cpuinfo")
    lines = listed.read_text(encoding="utf-8").splitlines() if listed.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return next(iter(names), platform.processor() or "CPU")
