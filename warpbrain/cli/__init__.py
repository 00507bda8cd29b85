"""The roof: parse, call, print. Nothing heavy is imported before a command is known: `commands.toml` says which there
are, and a command's module is imported when it is called."""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any

from warpbrain import __version__
from warpbrain.errors import InputError
from warpbrain.terminal.command import OneLineParser, exit_status
from warpbrain.terminal.completing import complete
from warpbrain.terminal.record import Record

_TYPES = {"path": Path, "int": int, "float": float}


@dataclass(frozen=True)
class _Range:
    """What the number of an argument can be, which is refused before anything is imported for it."""

    argument: argparse.Action
    least: float | None = None
    above: float | None = None
    below: float | None = None
    expected: str = ""

    def require(self, options: argparse.Namespace) -> None:
        """`InputError` if a number is given that is outside."""
        value = getattr(options, self.argument.dest)
        inside = value is None or (
            (self.least is None or value >= self.least)
            and (self.above is None or value > self.above)
            and (self.below is None or value < self.below)
        )
        if not inside:
            shown = f"{value:g}" if isinstance(value, float) else value
            expected = self.expected or f"a whole number of at least {self.least}"
            raise InputError(f"{self.argument.option_strings[0]} {shown}: expected {expected}")


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
    return exit_status(parser.prog, lambda: _call(options), options.record, debug)


def _call(options: argparse.Namespace) -> None:
    module, _, function = options.call.partition(":")
    with options.record.warnings_kept():
        for number in options.ranges:
            number.require(options)
        getattr(import_module(f"warpbrain.cli.{module}"), function)(options)


def _parser() -> _GroupedParser:
    described = tomllib.loads((files("warpbrain.cli") / "commands.toml").read_text(encoding="utf-8"))
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
    _add_commands(parser.commands, described["commands"], described["arguments"])
    return parser


def _add_commands(
    commands: argparse._SubParsersAction[Any], described: Mapping[str, Any], shared: Mapping[str, Any]
) -> None:
    """Add commands, or actions of one, as `commands.toml` describes them; `shared` are arguments of several."""
    for name, command in described.items():
        parser = commands.add_parser(name, help=command["help"], description=command.get("description"))
        ranges: list[_Range] = []
        parser.set_defaults(call=command.get("call"), ranges=ranges)
        # sections of the help and exclusive groups, by their name
        places: dict[str, argparse._ActionsContainer] = {"": parser}
        for flags, changed in command.get("arguments", {}).items():
            settings = dict(changed) if changed.get("apart") else {**shared.get(flags, {}), **changed}
            settings.pop("apart", None)
            section, group = settings.pop("under", ""), settings.pop("one_of", "")
            required = settings.pop("required", False) if group else False
            if section not in places:
                places[section] = parser.add_argument_group(section)
            if group not in places:
                places[group] = parser.add_mutually_exclusive_group(required=required)
            limits = {key: settings.pop(key) for key in ("least", "above", "below", "expected") if key in settings}
            argument = _add_argument(places[group or section], flags.split(), settings)
            ranges += [_Range(argument, **limits)] if limits else []
        if "actions" in command:
            # without an action a command that can be called is
            actions = parser.add_subparsers(dest="action", required="call" not in command, metavar="ACTION")
            _add_commands(actions, command["actions"], shared)


def _add_argument(place: argparse._ActionsContainer, flags: Sequence[str], settings: dict[str, Any]) -> argparse.Action:
    if "type" in settings:
        settings["type"] = _TYPES[settings["type"]]
    if settings.get("action") == "boolean":
        settings["action"] = argparse.BooleanOptionalAction
    if isinstance(settings.get("metavar"), list):
        settings["metavar"] = tuple(settings["metavar"])
    return place.add_argument(*flags, **settings)
