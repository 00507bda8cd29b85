"""`warpbrain view` and `compare`: a result in a window or a page of its own, and two side by side."""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

from warpbrain.atomic import check_writable
from warpbrain.cli.options import add_to
from warpbrain.errors import InputError


def add_view(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "view",
        help="look at a result in three dimensions",
        description="Opens the deformed body of a result in a window: drag to turn it, wheel to zoom, a slider for how "
        "far it moves, q to close. Without a display, --html FILE writes it as a page for any browser.",
    )
    add = partial(add_to, parser)
    add("result")
    add("--html", type=Path, metavar="FILE", help="write one file that any browser shows without a network instead")
    add("--exaggeration", type=float, metavar="N", help="draw motion N times as large (default: so that it is seen)")
    parser.set_defaults(call=_view)


def _view(options: argparse.Namespace) -> None:
    if options.exaggeration is not None and not 0.0 <= options.exaggeration < float("inf"):
        raise InputError(f"--exaggeration {options.exaggeration:g}: expected a number of at least 0")
    if options.html is not None:
        check_writable(options.html)
    elif not _has_display():
        raise InputError("view: there is no display here: --html FILE writes a page that any browser shows")

    from warpbrain.report.body_sections import window, write_view_page
    from warpbrain.report.state_files import read_state

    state = read_state(options.result)
    if options.html is None:
        window(state, options.exaggeration).show(title=f"warpbrain: {state.path}")
        return
    write_view_page(options.html, state, options.exaggeration)
    print(f"written: {options.html}")


def _has_display() -> bool:
    """Whether a window can be opened: always, where windows are not those of X11 or Wayland."""
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def add_compare(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "compare",
        help="two results side by side",
        description="Says what differs between two folders of results: inputs and versions, RMSE at recordings, "
        "displacement in mm, tissue with its intervals, verdicts. The folders may be of run, estimate, diagnose or "
        "ensemble, and on other meshes.",
    )
    parser.add_argument("first", type=Path, metavar="A", help="folder of results")
    parser.add_argument("second", type=Path, metavar="B", help="another one")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write it as JSON, too")
    parser.set_defaults(call=_compare)


def _compare(options: argparse.Namespace) -> None:
    from warpbrain.report.files import write_summary
    from warpbrain.report.page import lines
    from warpbrain.report.two_results import describe_two, read_result

    if options.json is not None:
        check_writable(options.json.absolute())
    first, second = read_result(options.first), read_result(options.second)
    try:
        comparison = describe_two(first, second)
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{options.first} and {options.second}: not as this version writes results: {type(error).__name__} {error}"
        ) from None
    print(*lines("compare.txt", "compare", comparison), sep="\n")
    if options.json is not None:
        write_summary(options.json.absolute(), comparison)
