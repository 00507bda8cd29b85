"""`warpbrain cases build NAME`: remake a shipped mesh from the installed wheels."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add_parser(actions: argparse._SubParsersAction[Any]) -> None:
    """Add the command to those of `warpbrain cases`."""
    parser = actions.add_parser(
        "build",
        help="remake a case's meshes from the MNI template in the nilearn wheel (needs warpbrain[build])",
        description="Remakes the meshes of a shipped case from the installed wheels, to the same meshes on the same "
        "versions. Needs the extra packages of `pip install warpbrain[build]`; downloads nothing.",
    )
    parser.add_argument("name", help="a shipped case: 0529, phantom, ...")
    parser.add_argument("--out", type=Path, default=Path("."), metavar="DIR", help="folder to write to (default: here)")
    parser.set_defaults(call=_build)


def _build(options: argparse.Namespace) -> None:
    from warpbrain.cases.building import NAMES, build
    from warpbrain.terminal.claim import claim

    if options.name in NAMES:
        claim(options.out / options.name)
    folder = build(options.name, options.out, progress=print)
    print(f"written to {folder}")
