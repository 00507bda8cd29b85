"""The roof: parse, call, print. Nothing heavy is imported before a command is known."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from warpbrain import __version__
from warpbrain.cli import cases, compare, diagnose, ensemble, estimate, gp, run, view, warp
from warpbrain.terminal.command import OneLineParser, exit_status
from warpbrain.terminal.record import Record


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status, see `exit_status`."""
    parser = OneLineParser(
        prog="warpbrain", description="Simulates the deformation of the brain, and says what it left out."
    )
    parser.add_argument("--version", action="version", version=f"warpbrain {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    run.add_parser(commands)
    estimate.add_parser(commands)
    diagnose.add_parser(commands)
    ensemble.add_parser(commands)
    view.add_parser(commands)
    warp.add_parser(commands)
    compare.add_parser(commands)
    cases.add_parser(commands)
    gp.add_parser(commands)
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error, with any command")
    given = sys.argv[1:] if arguments is None else list(arguments)
    # after the command, too, where people write it
    debug = "--debug" in given
    given = [word for word in given if word != "--debug"]
    options = parser.parse_args(given)
    options.record = Record(given, getattr(options, "quiet", False))
    return exit_status(parser.prog, lambda: _call(options), options.record, debug)


def _call(options: argparse.Namespace) -> None:
    with options.record.warnings_kept():
        options.call(options)
