"""Commands and their arguments as a TOML table describes them: parsers of them, ranges of numbers, calls.

A command has its `help`, its `description` and the function that is its `call`, in a module that is imported only then;
`arguments`, with the keywords of `add_argument`; and `actions`, which are commands of it. What the arguments have
beside these keywords is said in `warpbrain/cli/commands.toml`. And what a shell may complete of them, which needs the
extra `completion` (argcomplete).
"""

from __future__ import annotations

import argparse
import operator
import os
import tomllib
from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any

from warpbrain.errors import InputError


def _path(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("expected a path, found an empty text")
    return Path(text)


#: Types of arguments and comparisons of their numbers with limits, by their names in a table.
_TYPES = {"path": _path, "int": int, "float": float}
_LIMITS = {"least": operator.ge, "above": operator.gt, "below": operator.lt}


def described_in(package: str) -> dict[str, Any]:
    """The table `commands.toml` of a package."""
    return tomllib.loads((files(package) / "commands.toml").read_text(encoding="utf-8"))


def call(options: argparse.Namespace, package: str) -> None:
    """Run what was asked for, by a module of a package; `InputError`, before that is imported, if a number is out
    of its range."""
    for argument, limits in options.ranges:
        value = getattr(options, argument.dest)
        if value is not None and not all(_LIMITS[name](value, limits[name]) for name in _LIMITS if name in limits):
            shown = f"{value:g}" if isinstance(value, float) else value
            expected = limits.get("expected") or f"a whole number of at least {limits['least']}"
            raise InputError(f"{argument.option_strings[0]} {shown}: expected {expected}")
    module, _, function = options.call.partition(":")
    getattr(import_module(f"{package}.{module}"), function)(options)


def add_commands(
    commands: argparse._SubParsersAction[Any], described: Mapping[str, Any], shared: Mapping[str, Any]
) -> None:
    """Add commands, or actions of one, as a table describes them; `shared` are arguments of several."""
    for name, command in described.items():
        fill(commands.add_parser(name, help=command["help"], description=command.get("description")), command, shared)


def fill(parser: argparse.ArgumentParser, command: Mapping[str, Any], shared: Mapping[str, Any]) -> None:
    """Give a parser the arguments and actions of a command."""
    ranges: list[tuple[argparse.Action, dict[str, Any]]] = []
    parser.set_defaults(call=command.get("call"), ranges=ranges, program=parser.prog)
    # sections of the help and exclusive groups, by their name
    places: dict[str, argparse._ActionsContainer] = {"": parser}
    for flags, changed in command.get("arguments", {}).items():
        settings = dict(changed) if changed.get("apart") else {**shared.get(flags, {}), **changed}
        settings.pop("apart", None)
        section, group = settings.pop("under", ""), settings.pop("one_of", "")
        if section not in places:
            places[section] = parser.add_argument_group(section)
        if group not in places:
            places[group] = parser.add_mutually_exclusive_group(required=settings.get("required", False))
        if group:
            settings.pop("required", None)
        limits = {key: settings.pop(key) for key in (*_LIMITS, "expected") if key in settings}
        if "type" in settings:
            settings["type"] = _TYPES[settings["type"]]
        if settings.get("action") == "boolean":
            settings["action"] = argparse.BooleanOptionalAction
        if isinstance(settings.get("metavar"), list):
            settings["metavar"] = tuple(settings["metavar"])
        argument = places[group or section].add_argument(*flags.split(), **settings)
        if limits:
            ranges.append((argument, limits))
    if "actions" in command:
        # without an action a command that can be called is
        actions = parser.add_subparsers(dest="action", required="call" not in command, metavar="ACTION")
        add_commands(actions, command["actions"], shared)


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that asks, which it does by a variable of the environment, and end; else nothing."""
    if "_ARGCOMPLETE" not in os.environ:
        return
    from argcomplete import autocomplete
    from argcomplete.completers import DirectoriesCompleter

    folders = DirectoriesCompleter()

    def cases(prefix: str, **_: Any) -> list[str]:
        from warpbrain.cases.shipped import SHIPPED

        return [name for name in SHIPPED if name.startswith(prefix)] + list(folders(prefix))

    completers = {"--case": cases, "--with": _mechanisms, "--candidates": _mechanisms, "--out": folders}
    for action in _actions(parser):
        for option in action.option_strings:
            if option in completers:
                action.completer = completers[option]  # type: ignore[attr-defined]
        if action.dest in ("name", "folder") and not action.option_strings:
            action.completer = cases  # type: ignore[attr-defined]
    autocomplete(parser)


def shell_code(shell: str) -> str:
    """What a shell must be told once; `InputError` if argcomplete is not installed."""
    try:
        import argcomplete
    except ImportError:
        raise InputError("completion: needs argcomplete: pip install 'warpbrain[completion]'") from None
    return str(argcomplete.shellcode(["warpbrain"], shell=shell))


def mechanism_kinds() -> list[str]:
    """Kinds of mechanisms by their files, without importing what they need."""
    names = (file.name for file in (files("warpbrain") / "physics" / "mechanisms").iterdir())
    return sorted(name[:-3].replace("_", "-") for name in names if name.endswith(".py") and name != "__init__.py")


def _mechanisms(prefix: str, **_: Any) -> list[str]:
    return [kind for kind in mechanism_kinds() if kind.startswith(prefix)]


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All arguments of a parser and of its commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)
        else:
            yield action
