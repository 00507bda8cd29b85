"""`python -m warpbrain.bench mechanisms`: what each mechanism costs beside the plain model."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from datetime import date
from pathlib import Path
from typing import Any

from warpbrain.errors import InputError
from warpbrain.terminal.command import OneLineParser, exit_status


def main(arguments: Sequence[str]) -> int:
    """Parse, measure, print; returns the exit status."""
    parser = OneLineParser(
        prog="python -m warpbrain.bench mechanisms",
        description="Times a step and an iteration of Newton's method with each mechanism's example on the phantom "
        "under a light load, in turns with the plain model; the plain model beside itself says how exact that is.",
    )
    add = parser.add_argument
    add("--device", default=None, metavar="NAME", help="cpu, cuda:0, ... (default: the GPU if there is one)")
    add("--kinds", metavar="KIND,...", help="mechanisms (default: all)")
    add("--steps", type=int, default=100, help="time steps of each (default: 100)")
    add("--equilibria", type=int, default=7, help="equilibria of each (default: 7)")
    add("--precision", choices=("double", "single"), default="double", help="default: double")
    add("--out", type=Path, metavar="DIR", help="folder for a file with every sample, mechanisms_DEVICE_DATE.json")
    options = parser.parse_args(arguments)
    return exit_status(parser.prog, lambda: _bench(options))


def _bench(options: argparse.Namespace) -> None:
    for name in ("steps", "equilibria"):
        if getattr(options, name) < 1:
            raise InputError(f"--{name} {getattr(options, name)}: expected a whole number of at least 1")

    from warpbrain.physics.mechanisms import mechanisms

    known = mechanisms()
    kinds = list(known) if options.kinds is None else options.kinds.split(",")
    for kind in kinds:
        if kind not in known:
            raise InputError(f"--kinds {kind}: expected some of {', '.join(known)}")

    from warpbrain.atomic import output_folder, safe_name, whole_file
    from warpbrain.bench.host import processor
    from warpbrain.bench.mechanism_cost import measure_cost
    from warpbrain.cases.shipped import find_case
    from warpbrain.report.mechanisms.pages import BASE, PLAIN, ratio
    from warpbrain.report.summary import machine
    from warpbrain.simulation.system import find_device
    from warpbrain.terminal.progress import Progress
    from warpbrain.terminal.quiet import start_warp_quietly

    start_warp_quietly()
    device, versions, today = find_device(options.device), machine(), date.today().isoformat()
    out = None if options.out is None else output_folder(options.out)
    print(
        f"{device.name} ({device.alias}), {options.precision} precision, {BASE}: a step of 1 ms, {options.steps} of "
        f"each; an iteration of Newton's method, {options.equilibria} equilibria of each; "
        f"warpbrain {versions['warpbrain']}, Warp {versions['warp-lang']}"
    )
    print("median of the ratios with / without, which take turns")
    print(f"{'':<18} {'step':>6} {'ms':>8} {'CG':>9} {'Newton':>7} {'ms':>8} {'count':>7}")
    case, progress = find_case(BASE), Progress("bench")
    rows: list[dict[str, Any]] = []
    for number, kind in enumerate([PLAIN, *kinds]):
        progress.show(number / (len(kinds) + 1), kind)
        example = "" if kind == PLAIN else known[kind].example
        cost = measure_cost(case, kind, example, device.alias, options.precision, options.steps, options.equilibria)
        progress.clear()
        rows.append(asdict(cost))
        print(_line(rows[-1], ratio), flush=True)
    if out is not None:
        short = "cpu" if device.is_cpu else safe_name(device.name.lower().removeprefix("nvidia "))
        path = out / f"mechanisms_{short}_{today}.json"
        written = {
            "versions": versions,
            "device": processor() if device.is_cpu else device.name,
            "date": today,
            "precision": options.precision,
            "case": BASE,
            "rows": rows,
        }
        with whole_file(path) as scratch:
            scratch.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")
        print(f"written to {path}")


def _line(row: dict[str, Any], ratio: Any) -> str:
    from statistics import median

    def both(samples: dict[str, list[int]]) -> str:
        return f"{median(samples['with']):g}/{median(samples['plain']):g}"

    return (
        f"{row['kind']:<18} {ratio(row['step']):>6.2f} {median(row['step']['with']):>8.3f} "
        f"{both(row['cg_iterations']):>9} {ratio(row['newton']):>7.2f} {median(row['newton']['with']):>8.3f} "
        f"{both(row['newton_iterations']):>7}"
    )
