"""What a shell may complete words of a command with; needs the extra `completion` (argcomplete)."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from importlib.resources import files
from typing import Any

from warpbrain.errors import InputError


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
