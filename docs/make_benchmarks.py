"""Makes the tables of docs/benchmarks.md, bench/results/benchmarks.md: `python docs/make_benchmarks.py`.

Every figure comes from the latest files of `bench/results`, none is typed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean, median
from typing import Any

RESULTS = Path(__file__).parents[1] / "bench" / "results"
TABLES = RESULTS / "benchmarks.md"
PHASES = ("internal forces", "assemble system", "solve system", "time integration", "main loop")
STEP = "step without instruments"


def main() -> None:
    """Write the tables again."""
    TABLES.write_text(made(), encoding="utf-8")


def made() -> str:
    """All tables."""
    parts = ["# What was timed", "Made by `python docs/make_benchmarks.py`."]
    parts += ["## Beside the paper's Table 3 [ms]", table3(), "What bounds a step:", bounds()]
    return "\n\n".join([*parts, "## Next to other codes", cube(), ""]).rstrip() + "\n"


def latest(kind: str) -> list[tuple[str, dict[str, Any]]]:
    """The day and the content of the latest `KIND_date.json` or, of each device, `KIND_device_date.json`."""
    found = {}
    for file in sorted(RESULTS.glob(f"{kind}_*.json")):
        *device, day = file.stem.removeprefix(f"{kind}_").split("_")
        found[tuple(device)] = day, json.loads(file.read_text(encoding="utf-8"))
    return list(found.values())


def digits(value: float, count: int = 3) -> str:
    """A number with so many significant digits, and no exponent."""
    text = f"{value:#.{count}g}"
    return f"{float(text):.0f}" if "e" in text or text.endswith(".") else text


def span(values: Sequence[float], count: int = 2) -> str:
    """From the smallest to the largest."""
    ends = [digits(end, count) for end in (min(values), max(values))]
    return ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"


def machine(host: dict[str, Any]) -> str:
    """A processor, and how busy it was."""
    threads, load = host["hardware_threads"], host["load"]
    busy = ": **busy, so that times are too long**" if load > threads - 0.5 else ""
    return f"{host['processor']}, {threads} hardware threads, load {load:.1f} before{busy}"


def short(device: str) -> str:
    """Name of a device in a table."""
    return "CPU" if device.startswith("CPU") else device.removeprefix("NVIDIA ").split(" (")[0]


def table3() -> str:
    """Machines, and the paper's table with ours below each of its rows."""
    measured = latest("table3")
    lines = []
    for day, written in measured:
        device = written["rows"][0]["device"]
        name = short(device)
        where = machine(written["host"]) if name == "CPU" else device.split(" (")[0]
        lines.append(f"- {name}: {where}; {day}")
    heads = ["device", "row", "nodes", "tets", "CG", "pre-processing", "with capture", "x faster", "forces", "assembly"]
    heads += ["solve", "integration", "main loop", "**step**", "x faster"]
    lines += ["", f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for number, row in enumerate(measured[0][1]["rows"]):
        paper = row["paper_milliseconds"]
        cells = ["paper", row["row"], "?", "?", "?", f"{paper['pre-processing']:g}", "", ""]
        cells += [f"{paper[phase][0]:g}" for phase in PHASES] + ["", ""]
        lines.append(f"| {' | '.join(cells)} |")
        lines += [_row(written["rows"][number], row["row"]) for _, written in measured]
    return "\n".join(lines)


def _row(row: dict[str, Any], name: str) -> str:
    assert row["row"] == name, "files of other rows"
    samples, paper = row["milliseconds"], row["paper_milliseconds"]
    before, captured = fmean(samples["pre-processing"]), fmean(samples["capture"])
    step = fmean(samples[STEP])
    cells = [short(row["device"]), name, str(row["nodes"]), str(row["tetrahedra"]), f"{median(row['cg_iterations']):g}"]
    cells += [digits(before), digits(before + captured), f"**{digits(paper['pre-processing'] / (before + captured))}**"]
    cells += [digits(fmean(samples[phase])) for phase in PHASES]
    cells += [f"**{digits(step)}**", f"**{digits(paper['main loop'][0] / step)}**"]
    return f"| {' | '.join(cells)} |"


def bounds() -> str:
    """Launches and bytes of a step on each device."""
    lines = []
    for _, written in latest("table3"):
        rows = written["rows"]
        steps = [median(row["milliseconds"][STEP]) for row in rows]
        launches = [row["launches_per_step"] for row in rows]
        moved = [row["bytes_per_step"] / 1e6 for row in rows]
        each = [1000.0 * step / count for step, count in zip(steps, launches, strict=True)]
        rate = [size / step for size, step in zip(moved, steps, strict=True)]
        lines.append(
            f"- {short(rows[0]['device'])}: {span(launches, 3)} launches a step, {span(each)} us each; "
            f"{span(moved, 3)} MB a step, each array counted once a kernel, at {span(rate)} GB/s; "
            f"{digits(rows[-1]['tetrahedra'] / rows[0]['tetrahedra'], 2)} times the elements cost "
            f"{digits(steps[-1] / steps[0], 2)} times the time ({rows[-1]['row']} for {rows[0]['row']})"
        )
    return "\n".join(lines)


def cube() -> str:
    """The table of all codes, and how ours stands to each."""
    [(day, written)] = latest("cube")
    ours, *others = written["rows"]
    heads = ["code", "linear solver", "set-up [ms]", "full static solve [ms]", "both [ms]", "whole process [ms]"]
    heads += ["forces + tangent + assembly [ms]", "Newton", "out of balance", "peak RSS [MB]"]
    lines = [f"{machine(written['host'])}; {day}.", "", f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for row in written["rows"]:
        times = [f"{1000.0 * row[name]:.0f}" for name in ("setup", "solve", "together", "process")]
        assembly = digits(1000.0 * row["assembly"]) if "assembly" in row else "inside"
        cells = [f"{row['code']} {row['version']}", row["linear_solver"], *times, assembly, str(row["newton"])]
        lines.append(f"| {' | '.join([*cells, format(row['imbalance'], '.0e'), format(row['peak_rss_mb'], '.0f')])} |")
    lines += ["", "Time of each code over ours, from a mesh in memory to the solution, and of whole processes:", ""]
    for row in others:
        both, process = (digits(row[name] / ours[name], 2) for name in ("together", "process"))
        lines.append(f"- {row['code']}, {row['linear_solver']}: {both} and {process}")
    lines += [
        "",
        f"Ours is slow to begin: a first set-up in a process also loads kernels, a further one of a fresh mesh takes "
        f"{1000.0 * ours['setup_again']:.0f} ms and a further solve {1000.0 * ours['solve_again']:.0f} ms.",
        "",
        f"Norm of the displacement and reaction are those of `problem.py`, which seven codes found to 14 digits, to "
        f"{max(row[name] for row in written['rows'] for name in ('u_norm_error', 'reaction_error')):.0e} and better.",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
