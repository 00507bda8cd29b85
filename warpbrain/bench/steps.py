"""`python -m warpbrain.bench`: each phase of a step, and the paper's Table 3 beside it."""

from __future__ import annotations

import argparse
import statistics
from typing import Any

import warp as wp

from warpbrain.bench import command
from warpbrain.bench.measure import BODIES, PREPROCESSING, RESTART, STEP, measure_row
from warpbrain.bench.table3 import MAIN_LOOP, TABLE3
from warpbrain.kernels.module import find_device
from warpbrain.kernels.precision import find_precision
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
        print(
            f"{device.name} ({alias}), {options.precision} precision, CG to {tolerance:.2g}, h = 1 ms, "
            f"from rest again every {RESTART} steps; {command.release(versions)}"
        )
        print(f"mean (sd) ms of {options.steps} steps after {options.warmup}; 'paper' and 'x faster' from its Table 3;")
        print(f"pre-processing: from a mesh in memory, {BODIES} meshes that no cache has seen, kernels loaded;")
        print("each linear solve starts from the change of velocity of the step before")
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
    cg = statistics.median(measured["cg_iterations"])
    lines = [
        "",
        "{row}: {nodes} nodes, {tetrahedra} tetrahedra, {blocks} blocks of 3 x 3, ".format(**measured)
        + f"{cg:g} CG iterations (median)",
        f"  {'':<28}{'warpbrain':>18}{'paper':>18}{'x faster':>10}",
    ]
    first, *others = _columns(measured).items()
    # a body's first step is replayed once it is captured: both stand between a mesh in memory and that step
    both = [sum(pair) for pair in zip(first[1][0], measured["milliseconds"]["capture"], strict=True)]
    for label, (samples, paper) in (first, ("and capture of the step", (both, first[1][1])), *others):
        mean, sd = statistics.fmean(samples), statistics.pstdev(samples)
        theirs = f"{paper[0]:.2f}" + ("" if paper[1] is None else f" ({paper[1]:.1f})")
        lines.append(f"  {label:<28}{f'{mean:.3f} ({sd:.3f})':>18}{theirs:>18}{paper[0] / mean:>10.1f}")
    # of the last column, the step as users get it
    median, moved, launches = statistics.median(samples), measured["bytes_per_step"], measured["launches_per_step"]
    lines.append(
        f"  its median {median:.3f} ms; {moved / 1e6:.1f} MB moved and {launches} launches a step: "
        f"{moved / median / 1e6:.1f} GB/s, {1000.0 * median / launches:.1f} us a launch"
    )
    return lines


def _table(results: list[dict[str, Any]]) -> list[str]:
    """The paper's table again: a line for each row, each cell our mean (sd) | the paper's mean = how often faster."""
    heads = (f"{label.removeprefix('step '):<30}" for label in _columns(results[0]))
    lines = [f"{'row':<10} {'nodes':>6} {'tets':>6} {'CG':>5}  " + "  ".join(heads).rstrip()]
    for measured in results:
        cells = []
        for samples, (paper, _) in _columns(measured).values():
            mean = statistics.fmean(samples)
            cells.append(f"{mean:.3g} ({statistics.pstdev(samples):.2g}) | {paper:g} = {paper / mean:.3g}x".ljust(30))
        cg = statistics.median(measured["cg_iterations"])
        sizes = "{row:<10} {nodes:>6} {tetrahedra:>6} ".format(**measured) + f"{cg:>5g}  "
        lines.append(sizes + "  ".join(cells).rstrip())
    return lines
