"""The options of commands that write results, and what their logs say of a case."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from warpbrain.cases.case import Case
    from warpbrain.terminal.record import Record


def add_arguments(parser: argparse.ArgumentParser, usual: str) -> None:
    """Add where results go; `usual` is the name of their folder if nothing is said."""
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help=f"folder for the results (default: {usual}, or the next free {usual}-2, -3, ...)",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace the results that are in that folder")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def note_case(record: Record, case: Case, device: str) -> None:
    """Say in the log what is computed of which files, where, and by which versions."""
    from warpbrain.report.fingerprints import fingerprints
    from warpbrain.report.summary import machine

    record.note(
        case=str(case.path),
        sha256=", ".join(f"{name} {digest}" for name, digest in fingerprints(case).items()),
        device=device,
        versions=", ".join(f"{name} {version}" for name, version in machine().items()),
    )
