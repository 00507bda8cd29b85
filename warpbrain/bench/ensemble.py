"""`python -m warpbrain.bench ensemble`: how fast batches are, and what they gain over single runs."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warpbrain.errors import InputError
from warpbrain.terminal.command import OneLineParser, exit_status


def main(arguments: Sequence[str]) -> int:
    """Parse, measure, print; returns the exit status."""
    parser = OneLineParser(
        prog="python -m warpbrain.bench ensemble",
        description="Times batches of the coarse single-tissue phantom, 20 steps from rest, over their size.",
    )
    add = parser.add_argument
    add("--device", default=None, metavar="NAME", help="cpu, cuda:0, ... (default: the GPU if there is one)")
    add("--batches", metavar="B,...", help="sizes (default: 1,2,4,8 on a CPU, 1,4,16,32,64,128,256,512 on a GPU)")
    add("--precision", choices=("double", "single"), default="double", help="default: double")
    add("--processes", metavar="P,...", help="on a CPU: also the rate of so many processes, as 1,2")
    add("--samples", type=int, default=48, help="samples that the processes compute (default: 48)")
    add("--sweep", choices=("single", "multi"), help="also the paper's sweep to rest, 17 samples or 289 pairs")
    add("--json", type=Path, metavar="FILE", help="write every sample")
    options = parser.parse_args(arguments)
    return exit_status(parser.prog, lambda: _bench(options))


def _sizes(name: str, text: str) -> list[int]:
    numbers = text.split(",")
    for number in numbers:
        if not number.isdecimal() or int(number) < 1:
            raise InputError(f"--{name} {text}: expected whole numbers of at least 1, as 1,2,4")
    return [int(number) for number in numbers]


def _bench(options: argparse.Namespace) -> None:
    if options.samples < 1:
        raise InputError(f"--samples {options.samples}: expected a whole number of at least 1")
    batches = None if options.batches is None else _sizes("batches", options.batches)
    processes = [] if options.processes is None else _sizes("processes", options.processes)

    from warpbrain.atomic import check_writable, whole_file
    from warpbrain.bench.batches import (
        STEPS,
        measure_batches,
        measure_processes,
        measure_single,
        measure_sweep,
    )
    from warpbrain.report.summary import machine
    from warpbrain.simulation.system import find_device
    from warpbrain.terminal.progress import Progress
    from warpbrain.terminal.quiet import start_warp_quietly

    if options.json is not None:
        check_writable(options.json)
    start_warp_quietly()
    device, versions = find_device(options.device), machine()
    if batches is None:
        batches = [1, 4, 16, 32, 64, 128, 256, 512] if device.is_cuda else [1, 2, 4, 8]
    print(
        f"{device.name} ({device.alias}), {options.precision} precision, coarse phantom of one tissue, draws of its "
        f"prior, {STEPS} steps of 1 ms from rest; warpbrain {versions['warpbrain']}, Warp {versions['warp-lang']}"
    )
    written: dict[str, Any] = {"versions": versions, "device": device.name, "precision": options.precision}
    progress = Progress("bench")
    progress.show(0.0, "single runs")
    single = measure_single(device.alias, options.precision)
    progress.clear()
    print(f"single run: {single:.3f} ms a step")
    print(" batch  ms a step and sample  x single     CG  MB a step    GB/s  GB held")
    written |= {"single_milliseconds": single, "batches": []}
    for measured in measure_batches(batches, device.alias, options.precision):
        print(
            f"{measured.slots:>6} {measured.best:>21.4f} {single / measured.best:>9.1f} {measured.cg_iterations:>6.1f} "
            f"{measured.bytes_per_step / 1e6:>10.1f} {measured.bandwidth:>7.0f} {measured.memory / 1e9:>8.2f}"
            + (f"   {measured.failed} failed" if measured.failed else ""),
            flush=True,
        )
        written["batches"].append(vars(measured))
    rates: dict[str, float] = {}
    for count in processes:
        progress.show(0.5, f"{count} processes")
        rates[str(count)] = measure_processes(count, options.samples, options.precision, start_warp_quietly)
        progress.clear()
        rate = rates[str(count)]
        print(
            f"{count} processes: {rate:.2f} samples a second, {rate / next(iter(rates.values())):.2f} times the first"
        )
    written["samples_a_second_by_processes"] = rates
    if options.sweep is not None:
        progress.show(0.9, "sweep")
        seconds, samples, failed, iterations = measure_sweep(options.sweep, device.alias, options.precision)
        progress.clear()
        print(f"the paper's sweep to rest, {options.sweep}: {samples} samples in {seconds:.1f} s, {failed} failed, "
              f"{iterations} CG iterations")  # fmt: skip
        written["sweep"] = {"seconds": seconds, "samples": samples, "failed": failed, "cg_iterations": iterations}
    if options.json is not None:
        with whole_file(options.json) as scratch:
            scratch.write_text(json.dumps(written, indent=1) + "\n")
        print(f"written to {options.json}")
