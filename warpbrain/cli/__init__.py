"""The roof: parse, call, print. Nothing heavy is imported before a command is known: `commands.toml` says which there
are, and a command's module is imported when it is called."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from warpbrain import __version__
from warpbrain.terminal.arguments import add_commands, call, complete, described_in
from warpbrain.terminal.command import OneLineParser, exit_status
from warpbrain.terminal.record import Record


class _GroupedParser(OneLineParser):
    """A parser whose help lists its commands under titles."""

    commands: argparse._SubParsersAction[Any]  # of `add_subparsers`
    groups: Mapping[str, Sequence[str]]  # title and names of its commands, in their order

    def format_help(self) -> str:
        """As `argparse` formats it, with a section for each group."""
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        by_name = {action.dest: action for action in self.commands._get_subactions()}
        sections: dict[str, list[argparse.Action]] = {
            title: [by_name[name] for name in names] for title, names in self.groups.items()
        }
        sections["options"] = [action for action in self._actions if action is not self.commands]
        for title, actions in sections.items():
            formatter.start_section(title)
            formatter.add_arguments(actions)
            formatter.end_section()
        formatter.add_text(self.epilog)
        return formatter.format_help()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status, see `exit_status`."""
    parser = _parser()
    complete(parser)
    given = sys.argv[1:] if arguments is None else list(arguments)
    # after the command, too, where people write it
    debug = "--debug" in given
    given = [word for word in given if word != "--debug"]
    options = parser.parse_args(given)
    options.record = Record(given, getattr(options, "quiet", False))

    def work() -> None:
        with options.record.warnings_kept():
            call(options, "warpbrain.cli")

    return exit_status(parser.prog, work, options.record, debug)


def _parser() -> _GroupedParser:
    described = described_in("warpbrain.cli")
    parser = _GroupedParser(
        prog="warpbrain",
        description="Simulates the deformation of the brain, and says what it left out.",
        epilog="Begin with: warpbrain run --case 0529. More of a command: warpbrain COMMAND --help.",
    )
    parser.add_argument("--version", action="version", version=f"warpbrain {__version__}")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error, with any command")
    parser.commands = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", parser_class=OneLineParser
    )
    parser.groups = described["groups"]
    add_commands(parser.commands, described["commands"], described["arguments"])
    return parser
