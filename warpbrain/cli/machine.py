"""`warpbrain doctor`: whether this machine computes what it should; `completion`: what its shell needs to complete
words."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

from warpbrain.errors import SolveError
from warpbrain.terminal.completing import SHELLS, shell_code
from warpbrain.terminal.progress import Progress

if TYPE_CHECKING:
    from warpbrain.terminal.record import Record


def add_doctor(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "doctor",
        help="devices, versions, memory, and a self-test of a few seconds: for a report of a defect",
        description="Prints versions, devices, driver, memory and the folder of compiled kernels, and lets each device "
        "find a state that is known exactly. The first time kernels are compiled, which takes longer. Exit status 1 "
        "if a device is wrong.",
    )
    parser.add_argument("--json", action="store_true", help="print it as JSON")
    parser.set_defaults(call=_doctor)


def _doctor(options: argparse.Namespace) -> None:
    from warpbrain.bench.health import health, health_lines
    from warpbrain.terminal.quiet import start_warp_quietly

    record: Record = options.record
    start_warp_quietly()
    with Progress("self-test", options.json) as progress:
        report = health(lambda device: progress.show(0.0, device))
    record.say(*([json.dumps(report, indent=1)] if options.json else health_lines(report)), sep="\n")
    failed = [test["device"] for test in report["self_test"] if test["problem"]]
    if failed:
        raise SolveError(f"doctor: the self-test failed on {', '.join(failed)}")


def add_completion(commands: argparse._SubParsersAction[Any]) -> None:
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
