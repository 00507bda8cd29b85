"""`warpbrain completion SHELL`: what a shell needs to complete commands, options, cases and mechanisms."""

from __future__ import annotations

import argparse
from typing import Any

from warpbrain.terminal.completing import SHELLS, shell_code


def add_parser(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "completion",
        help="let the shell complete commands, options, cases and mechanisms",
        description="Prints what the shell must be told once (needs pip install 'warpbrain[completion]'). bash: put "
        'eval "$(warpbrain completion bash)" into ~/.bashrc; zsh likewise; fish: warpbrain completion fish > '
        "~/.config/fish/completions/warpbrain.fish",
    )
    parser.add_argument("shell", choices=SHELLS)
    parser.set_defaults(call=lambda options: print(shell_code(options.shell)))
