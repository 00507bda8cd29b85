"""`warpbrain view` and `compare`: a result in a window or a page of its own, and two side by side."""

import argparse
import os
import sys

from warpbrain.atomic import check_writable
from warpbrain.errors import InputError
from warpbrain.report.body_sections import window, write_view_page
from warpbrain.report.files import read_state, write_summary
from warpbrain.report.page import lines
from warpbrain.report.two_results import describe_two, read_result


def view(options: argparse.Namespace) -> None:
    """Show a result in a window, or write a page of it."""
    # windows that are not those of X11 or Wayland can always be opened
    has_display = sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if options.html is not None:
        check_writable(options.html, options.overwrite)
    elif not has_display:
        raise InputError("view: there is no display here: --html FILE writes a page that any browser shows")
    state = read_state(options.result)
    if options.html is None:
        window(state, options.exaggeration).show(title=f"warpbrain: {state.path}")
        return
    write_view_page(options.html, state, options.exaggeration)
    print(f"written: {options.html}")


def compare(options: argparse.Namespace) -> None:
    """Say what differs between two folders of results."""
    if options.json is not None:
        check_writable(options.json.absolute(), options.overwrite)
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
