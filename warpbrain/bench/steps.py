"""`python -m warpbrain.bench`: each phase of a step, and the paper's Table 3 beside it."""

from __future__ import annotations

import argparse
import statistics
from typing import Any

import warp as wp

from warpbrain.bench import command
from warpbrain.bench.measure import BODIES, PREPROCESSING, RESTART, STEP, measure_row
from warpbrain.bench.table3 import MAIN_LOOP, TABLE3
from warpbrain.kernels.module import find_device, find_precision
from warpbrain.report.page import lines
from warpbrain.simulation.dynamics import finest_tolerance
from warpbrain.terminal.progress import Progress


def bench(options: argparse.Namespace) -> None:
    """Measure and print."""
    names = command.chosen("--rows", options.rows, list(TABLE3))
    versions, where = command.start(options), command.host()
    devices = [d.alias for d in wp.get_devices()] if options.device == "all" else [find_device(options.device).alias]
    results = []
    for alias in devices:
        device = wp.get_device(alias)
        tolerance = finest_tolerance(options.tol, find_precision(options.precision))
        command.say("steps", device, options, tolerance, RESTART, BODIES, command.release(versions))
        progress = Progress("bench")
        for number, name in enumerate(names):
            progress.show(number / len(names), f"{name} on {alias}")
            measured = measure_row(TABLE3[name], alias, options.precision, options.steps, options.warmup, options.tol)
            progress.clear()
            results.append(measured)
            print(*_lines(measured), sep="\n")
        print("", *_table(results[-len(names) :]), sep="\n")
    command.write(options.json, {"versions": versions, "host": where, "rows": results})


def _columns(measured: dict[str, Any]) -> dict[str, tuple[list[float], tuple[float, float | None]]]:
    """Samples beside the paper's mean and sd [ms], by what they are of."""
    ours, paper = measured["milliseconds"], measured["paper_milliseconds"]
    theirs = {**paper, PREPROCESSING: (paper[PREPROCESSING], None), STEP: paper[MAIN_LOOP]}
    return {name: (samples, theirs[name]) for name, samples in ours.items() if name in theirs}


def _lines(measured: dict[str, Any]) -> list[str]:
    """A row of the table with its phases, ours beside the paper's."""
    columns = _columns(measured)
    first, *others = columns.items()
    # a body's first step is replayed once it is captured: both stand between a mesh in memory and that step
    both = [sum(pair) for pair in zip(first[1][0], measured["milliseconds"]["capture"], strict=True)]
    rows = first, ("and capture of the step", (both, first[1][1])), *others
    return lines("bench.txt", "row", measured, rows, columns[STEP][0], statistics)


def _table(results: list[dict[str, Any]]) -> list[str]:
    """The paper's table again: a line for each row, each cell our mean (sd) | the paper's mean = how often faster."""
    heads = [label.removeprefix("step ") for label in _columns(results[0])]
    rows = [(measured, _columns(measured).values()) for measured in results]
    return lines("bench.txt", "table", heads, rows, statistics)
