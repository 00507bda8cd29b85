"""The roof: parse, call, print. Nothing heavy is imported before a command is known."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from warpbrain import __version__
from warpbrain.cli import build, run
from warpbrain.errors import InputError, SolveError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status: 0 done, 1 no answer found, 2 bad input, 130 interrupted."""
    parser = argparse.ArgumentParser(
        prog="warpbrain", description="Simulates the deformation of the brain, and says what it left out."
    )
    parser.add_argument("--version", action="version", version=f"warpbrain {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    run.add_parser(commands)
    build.add_parser(commands)
    options = parser.parse_args(arguments)
    from warpbrain.cli.interrupt import stop_promptly

    try:
        with stop_promptly():
            options.call(options)
    except InputError as error:
        print(f"warpbrain: error: {error}", file=sys.stderr)
        return 2
    except SolveError as error:
        print(f"warpbrain: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nwarpbrain: interrupted; nothing half-written was left", file=sys.stderr)
        return 130
    return 0
