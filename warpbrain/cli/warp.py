"""`warpbrain warp`: images and points as a result deforms them; and the same options for commands that make results."""

import argparse
from pathlib import Path

from warpbrain.atomic import check_output_folder
from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.report import warped
from warpbrain.report.files import SavedState, read_state
from warpbrain.report.warped import WarpRequest, read_request, write_warped
from warpbrain.terminal.progress import Progress
from warpbrain.terminal.record import Record
from warpbrain.terminal.result_folder import results_in


def requested(options: argparse.Namespace) -> WarpRequest | None:
    """What is to be warped, read before long work so that what is wrong with it is known then; None if nothing is."""
    if options.image is None and options.labels is None and not options.points:
        return None

    return read_request(options.image, options.labels, options.points)


def check_place(request: WarpRequest | None, case: Case) -> None:
    """`InputError` if what is to be warped is not of the case, before anything is computed."""
    if request is None:
        return
    if case.specimen is not None:
        raise InputError(f"{case.path}: [specimen]: --image, --labels and --points are of a body, not of tests")
    warped.check_place(request, case.mesh, case.path)


def warp(state: SavedState, out: Path, request: WarpRequest, record: Record, quiet: bool) -> None:
    """Warp by the body of a result, say what there is to say and note the names of the files."""
    with Progress("warping", quiet) as progress:
        lines, files = write_warped(out, state, request, progress.show)
    record.say("", *lines)
    record.files += files


def warp_result(options: argparse.Namespace) -> None:
    """Warp images and points by a result."""
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
