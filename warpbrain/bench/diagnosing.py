"""`python -m warpbrain.bench diagnose`: how long each stage of a diagnosis takes."""

import argparse
import platform
import time
from datetime import date

from warpbrain.atomic import safe_name
from warpbrain.bench import command
from warpbrain.cases.shipped import find_case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.estimation.options import Listener
from warpbrain.kernels.module import find_device
from warpbrain.terminal.progress import Progress


def bench(options: argparse.Namespace) -> None:
    """Measure and print."""
    versions, device, today = command.start(options), find_device(options.device), date.today().isoformat()
    case = find_case(options.case, options.tissue)
    runs, diagnosis = [], None
    with Progress("bench") as progress:
        for number in range(options.runs):
            begun = time.perf_counter()
            listener = Listener(lambda text, part=number / options.runs: progress.show(part, text))  # type: ignore[misc]
            diagnosis = Diagnosing(case, device=device.alias, listener=listener).run()
            runs.append({**diagnosis.seconds, "total": time.perf_counter() - begun})
    assert diagnosis is not None
    measured = {
        "case": case.name,
        "numbers": len(diagnosis.base.at.sensors),
        "equilibria": diagnosis.base.states.solves,
        "device": f"{device.name} ({device.alias})",
        "processor": platform.processor() or platform.machine(),
        "date": today,
        "versions": versions,
        "verdict": diagnosis.verdict,
        "seconds": runs,
    }
    command.say("diagnoses", measured, command.release(versions))
    name = f"diagnose_{safe_name(device.alias)}_{today}.json"
    command.write(options.out and options.out / name, measured)
