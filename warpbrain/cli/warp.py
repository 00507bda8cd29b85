"""`warpbrain warp`: images and points as a result deforms them; and the same options for commands that make results."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpbrain.cli.options import WARPED, add_to
from warpbrain.errors import InputError
from warpbrain.terminal.progress import Progress

if TYPE_CHECKING:
    from warpbrain.cases.case import Case
    from warpbrain.report.state_files import SavedState
    from warpbrain.report.warped import WarpRequest
    from warpbrain.terminal.record import Record


def add_parser(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "warp",
        help="warp images and points by a result",
        description="Writes displacement.nii.gz, transforms for ITK, ANTs and 3D Slicer in both directions, the warped "
        "image and labels, moved points, displacement_sd.nii.gz and trust.nii.gz where the result knows them, and a "
        "script that loads all of it in 3D Slicer (see docs/images.md).",
    )
    add = partial(add_to, parser)
    add("result", *WARPED)
    add("--out", help="folder for the files (default: that of the result)")
    add("--overwrite", help="replace what was warped by this result before")
    add("--quiet")
    parser.set_defaults(call=_run)


def requested(options: argparse.Namespace) -> WarpRequest | None:
    """What is to be warped, read before long work so that what is wrong with it is known then; None if nothing is."""
    if options.image is None and options.labels is None and not options.points:
        return None
    from warpbrain.report.warped import read_request

    return read_request(options.image, options.labels, options.points)


def check_place(request: WarpRequest | None, case: Case) -> None:
    """`InputError` if what is to be warped is not of the case, before anything is computed."""
    if request is None:
        return
    if case.specimen is not None:
        raise InputError(f"{case.path}: [specimen]: --image, --labels and --points are of a body, not of tests")
    from warpbrain.report.warped import check_place

    check_place(request, case.mesh, case.path)


def warp(state: SavedState, out: Path, request: WarpRequest, record: Record, quiet: bool) -> None:
    """Warp by the body of a result, say what there is to say and note the names of the files."""
    from warpbrain.report.warped import write_warped

    with Progress("warping", quiet) as progress:
        lines, files = write_warped(out, state, request, progress.show)
    record.say("", *lines, sep="\n")
    record.files += files


def _run(options: argparse.Namespace) -> None:
    from warpbrain.atomic import check_output_folder
    from warpbrain.report import warped
    from warpbrain.report.state_files import read_state
    from warpbrain.terminal.result_folder import results_in

    request = requested(options)
    if request is None:
        raise InputError("expected --image, --labels or --points: what is to be warped")
    record: Record = options.record
    out = options.out or (options.result if options.result.is_dir() else options.result.parent)
    # no folder is made for a result that is none, or an image of another body
    state = read_state(options.result)
    warped.check_place(request, state.mesh, state.path)
    if not options.overwrite and (there := warped.in_the_way(out, request)):
        raise InputError(f"{out}: has {', '.join(there)} already: --overwrite replaces them, --out writes elsewhere")
    check_output_folder(out)
    record.note(result=str(state.path))
    # beside the result and what else was made of it
    with results_in(out, record, replace=False):
        warp(state, out, request, record, options.quiet)
