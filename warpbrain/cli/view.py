"""`warpbrain view`: a deformed body in a window, or as a page that needs neither a window nor a network."""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

from warpbrain.cli.options import add_to
from warpbrain.errors import InputError


def add_parser(commands: argparse._SubParsersAction[Any]) -> None:
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
    parser.set_defaults(call=_run)


def _run(options: argparse.Namespace) -> None:
    if options.exaggeration is not None and not 0.0 <= options.exaggeration < float("inf"):
        raise InputError(f"--exaggeration {options.exaggeration:g}: expected a number of at least 0")
    if options.html is not None:
        from warpbrain.atomic import check_writable

        check_writable(options.html)
    elif not _has_display():
        raise InputError("view: there is no display here: --html FILE writes a page that any browser shows")

    from warpbrain.report.state_files import read_state
    from warpbrain.report.view import show, write_view_page

    state = read_state(options.result)
    if options.html is None:
        show(state, options.exaggeration)
        return
    write_view_page(options.html, state, options.exaggeration)
    print(f"written: {options.html}")


def _has_display() -> bool:
    """Whether a window can be opened: always, where windows are not those of X11 or Wayland."""
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
