"""What commands share: how values of options are checked, and what logs say of a case."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.report.files import fingerprints
from warpbrain.report.picture import Pictures
from warpbrain.report.summary import machine
from warpbrain.simulation.system import System
from warpbrain.terminal.record import Record


def require_whole(options: argparse.Namespace, **least: int) -> None:
    """Refuse numbers that are given and below the least that they can be."""
    for name, lowest in least.items():
        value = getattr(options, name)
        if value is not None and value < lowest:
            raise InputError(f"--{name} {value}: expected a whole number of at least {lowest}")


def require_poisson(poisson: float | None) -> None:
    """Refuse a Poisson ratio that is none."""
    if poisson is not None and not -1.0 < poisson < 0.5:
        raise InputError(f"--poisson {poisson:g}: expected a number in the open interval (-1, 0.5)")


def require_tolerance(tolerance: float) -> None:
    """Refuse a relative out-of-balance force that is none."""
    if not 0.0 < tolerance < 1.0:
        raise InputError(f"--tolerance {tolerance:g}: expected a number between 0 and 1")


def require_positive(name: str, value: float | None, expected: str) -> None:
    """Refuse a number that is given and is not positive and finite."""
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise InputError(f"--{name} {value:g}: expected {expected}")


def note_case(record: Record, case: Case, device: str) -> None:
    """Say in the log what is computed of which files, where, and by which versions."""
    record.note(
        case=str(case.path),
        sha256=", ".join(f"{name} {digest}" for name, digest in fingerprints(case).items()),
        device=device,
        versions=", ".join(f"{name} {version}" for name, version in machine().items()),
    )


def note_device(record: Record, case: Case, system: System, precision: str) -> None:
    """Say in the log and in print where is computed."""
    where = f"{system.device.name} ({system.device.alias}), {precision} precision"
    note_case(record, case, where)
    record.say(f"  device    {where}")


def drawn(pictures: Pictures | str, say: Callable[..., None]) -> list[str]:
    """Names of the files that a page and its pictures are in; says why there are no pictures, if there are none."""
    if isinstance(pictures, str):
        say("", f"deformation.png is not drawn: {pictures}", sep="\n")
        return ["report.html"]
    return ["deformation.png", "report.html"]
