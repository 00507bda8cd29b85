"""`warpbrain compare A B`: two results side by side."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add_parser(commands: argparse._SubParsersAction[Any]) -> None:
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
    from warpbrain.atomic import check_writable
    from warpbrain.errors import InputError
    from warpbrain.report.files import write_summary
    from warpbrain.report.saved_result import read_result
    from warpbrain.report.two_results import describe_two, two_lines

    if options.json is not None:
        check_writable(options.json.absolute())
    first, second = read_result(options.first), read_result(options.second)
    try:
        said = describe_two(first, second)
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{options.first} and {options.second}: not as this version writes results: {type(error).__name__} {error}"
        ) from None
    print(*two_lines(said), sep="\n")
    if options.json is not None:
        write_summary(options.json.absolute(), said)
