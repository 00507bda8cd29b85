"""`warpbrain doctor`: whether this machine computes what it should; `completion`: what its shell needs to complete
words."""

import argparse
import json

from warpbrain.errors import SolveError
from warpbrain.terminal.arguments import shell_code
from warpbrain.terminal.progress import Progress
from warpbrain.terminal.record import Record


def doctor(options: argparse.Namespace) -> None:
    """Say what this machine has, and let each of its devices find a state that is known exactly."""
    from warpbrain.bench.health import health
    from warpbrain.report.page import lines
    from warpbrain.terminal.quiet import start_warp_quietly

    record: Record = options.record
    start_warp_quietly()
    with Progress("self-test", options.json) as progress:
        report = health(lambda device: progress.show(0.0, device))
    record.say(*([json.dumps(report, indent=1)] if options.json else lines("doctor.txt", "health", report)))
    failed = [test["device"] for test in report["self_test"] if test["problem"]]
    if failed:
        raise SolveError(f"doctor: the self-test failed on {', '.join(failed)}")


def completion(options: argparse.Namespace) -> None:
    """Print what the shell must be told once."""
    print(shell_code(options.shell))
