"""Options that several commands have, how their values are checked, and what logs say of a case."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpbrain.errors import InputError

if TYPE_CHECKING:
    from warpbrain.cases.case import Case
    from warpbrain.report.picture import Pictures
    from warpbrain.simulation.system import System
    from warpbrain.terminal.record import Record

_RESULT = "folder that run, estimate, diagnose or ensemble has written, or its .vtu file"
_OPTIONS: dict[str, dict[str, Any]] = {
    "result": {"type": Path, "metavar": "RESULT", "help": _RESULT},
    "--case": {
        "required": True,
        "metavar": "NAME",
        "help": "0529, ... (see warpbrain cases), or the path of a case folder",
    },
    "--tissue": {"choices": ("single", "multi"), "default": "multi", "help": "one tissue, or grey and white (default)"},
    "--model": {
        "metavar": "LAW",
        "help": "neo-hookean, mooney-rivlin or ogden for every tissue (default: the case's own)",
    },
    "--gp": {"metavar": "MODEL"},
    "--variant": {"choices": ("corrected", "as_published")},
    "--poisson": {"type": float, "metavar": "NU", "help": "Poisson ratio of every tissue, in (-1, 0.5)"},
    "--seed": {"type": int, "metavar": "S"},
    "--tolerance": {"type": float, "default": 1e-8, "metavar": "TOL"},
    "--device": {"metavar": "NAME", "help": "cpu, cuda:0, ... (default: the GPU if there is one, else cpu)"},
    "--precision": {"choices": ("double", "single"), "default": "double", "help": "default: double"},
    "--no-discretisation": {"action": "store_true", "help": "take the mesh for exact"},
    "--steps": {"type": int, "metavar": "N", "help": "follow the motion for N time steps of 1 ms"},
    "--to-rest": {"action": "store_true", "help": "follow the damped motion until it is at rest"},
    "--image": {
        "type": Path,
        "metavar": "FILE",
        "help": "image to warp, on whose grid all is written: .nii.gz, .nrrd, .mgz",
    },
    "--labels": {"type": Path, "metavar": "FILE", "help": "label volume to warp"},
    "--points": {
        "type": Path,
        "nargs": "+",
        "metavar": "FILE",
        "default": [],
        "help": "points to move: .mrk.json and .fcsv of 3D Slicer, BIDS electrodes.tsv",
    },
    "--out": {"type": Path, "metavar": "DIR"},
    "--csv": {"type": Path, "metavar": "FILE"},
    "--overwrite": {"action": "store_true", "help": "replace the results that are in that folder"},
    "--quiet": {"action": "store_true", "help": "print nothing but errors"},
}
#: What a result can carry along.
WARPED = ("--image", "--labels", "--points")


def add_to(parser: argparse._ActionsContainer, *names: str, **changed: Any) -> None:
    """Add options, those of several commands as `_OPTIONS` says; `changed` is what is other for this one."""
    for name in names:
        parser.add_argument(name, **{**_OPTIONS.get(name, {}), **changed})


def add_results(parser: argparse.ArgumentParser, usual: str) -> None:
    """Add where results go; `usual` is the name of their folder if nothing is said."""
    add_to(parser, "--out", help=f"folder for the results (default: {usual}, or the next free {usual}-2, -3, ...)")
    add_to(parser, "--overwrite", "--quiet")


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
    from warpbrain.report.files import fingerprints
    from warpbrain.report.summary import machine

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
