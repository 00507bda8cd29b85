"""Each phase of a step beside that of another checkout: `python bench/against.py ../other --out bench/results`.

A process of the other checkout, one of this and a second one of this take turns of 20 steps from rest; ratios are of
turns that are neighbours in time, and this checkout beside itself says how exact they are. Pre-processing is of meshes
that no cache has seen. Processor time on a CPU, which other work on the machine disturbs less.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parents[1]
SIDES = ("other", "this", "this again")
ROWS = ("st/coarse", "mt/coarse", "mt/fine")


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkout", type=Path, help="folder of the other checkout")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--turns", type=int, default=9)
    parser.add_argument("--out", type=Path, help="folder for a file with every sample")
    options = parser.parse_args()
    written: dict[str, Any] = {
        "date": date.today().isoformat(),
        "commits": {"other": _commit(options.checkout), "this": _commit(HERE)},
        "rows": {},
    }
    for row in ROWS:
        turns = measure(options.checkout, row, options.device, options.turns)
        written["device"] = turns["this"][0].pop("device")
        written["rows"][row] = turns
        for name in turns["this"][0]:
            here = _ratio(turns, name, "this", "other")
            noise = _ratio(turns, name, "this again", "this")
            print(f"{row:<10} {name:<18} {_median(turns['this'], name):>8.3f} ms  this/other {here:.3f}  "
                  f"this/this {noise:.3f}", flush=True)  # fmt: skip
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        name = "cpu" if options.device == "cpu" else written["device"].lower().removeprefix("nvidia ").replace(" ", "-")
        file = options.out / f"against_{name}_{written['date']}.json"
        file.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")
        print(f"written to {file}")


def measure(checkout: Path, row: str, device: str, turns: int) -> dict[str, list[Any]]:
    """Turns of each side, each with its median time of every phase [ms]."""
    workers = {
        side: subprocess.Popen(
            [sys.executable, __file__, "--worker", row, device],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(folder)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for side, folder in zip(SIDES, (checkout.resolve(), HERE, HERE), strict=True)
    }
    found: dict[str, list[Any]] = {side: [] for side in SIDES}
    # the first turn of each loads its kernels
    for turn in range(turns + 1):
        for side in SIDES if turn % 2 else reversed(SIDES):
            pipe = workers[side]
            assert pipe.stdin is not None and pipe.stdout is not None
            print("go", file=pipe.stdin, flush=True)
            answer = json.loads(pipe.stdout.readline())
            assert Path(answer.pop("package")).is_relative_to(checkout.resolve() if side == "other" else HERE)
            if turn:
                found[side].append(answer)
    for pipe in workers.values():
        pipe.communicate()
    return found


def work(row: str, device: str) -> None:
    """Answer each line of the input with a turn."""
    import warpbrain
    from warpbrain.bench.measure import RESTART
    from warpbrain.bench.table3 import TABLE3
    from warpbrain.cases.shipped import find_case
    from warpbrain.mesh import TetMesh
    from warpbrain.simulation.dynamics import PHASES, Simulator
    from warpbrain.simulation.of_case import model_of
    from warpbrain.simulation.system import System
    from warpbrain.terminal.quiet import start_warp_quietly

    wp = start_warp_quietly()
    now = time.process_time if device == "cpu" else time.perf_counter
    case = find_case(TABLE3[row].case, TABLE3[row].tissue)
    simulator = Simulator(System(model_of(case), device))
    simulator.capture()
    bodies = itertools.count(1)
    for _ in sys.stdin:
        taken: dict[str, list[float]] = {}
        for _ in range(5):
            arrays = fresh_arrays(case.mesh, next(bodies))
            start = now()
            System(model_of(replace(case, mesh=TetMesh(*arrays))), device)
            wp.synchronize_device(device)
            taken.setdefault("pre-processing", []).append(1000.0 * (now() - start))
        simulator.reset()
        for _ in range(RESTART):
            clock = Clock(now, lambda: wp.synchronize_device(device))
            # an older checkout has a method of its own for it
            getattr(simulator, "timed_step", simulator.step)(clock)
            for name in PHASES:
                taken.setdefault(name, []).append(1000.0 * clock.seconds[name])
        simulator.reset()
        for _ in range(RESTART):
            start = now()
            simulator.step()
            wp.synchronize_device(device)
            taken.setdefault("step in one graph", []).append(1000.0 * (now() - start))
        medians = {name: statistics.median(samples) for name, samples in taken.items()}
        print(json.dumps({"package": warpbrain.__file__, "device": wp.get_device(device).name, **medians}), flush=True)


def fresh_arrays(mesh: Any, number: int) -> tuple[Any, ...]:
    """As `warpbrain.bench.measure`, which the other checkout may not have, of what the plain model needs of a mesh."""
    points = mesh.points + np.array([1e-6 * number, 0.0, 0.0])
    turned = (np.roll(values, number, axis=0) for values in (mesh.tetrahedra, mesh.tissue))
    return points, *turned, {name: members.copy() for name, members in mesh.node_sets.items()}


class Clock:
    """A `PhaseClock` for another time than that on the wall."""

    def __init__(self, now: Callable[[], float], wait: Callable[[], None]) -> None:
        self.now, self.wait = now, wait
        self.seconds: dict[str, float] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time a block as part of a phase."""
        self.wait()
        start = self.now()
        yield
        self.wait()
        self.seconds[name] = self.seconds.get(name, 0.0) + self.now() - start


def _ratio(turns: dict[str, list[Any]], name: str, above: str, below: str) -> float:
    return statistics.median(a[name] / b[name] for a, b in zip(turns[above], turns[below], strict=True))


def _median(turns: list[Any], name: str) -> float:
    return statistics.median(turn[name] for turn in turns)


def _commit(folder: Path) -> str:
    told = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=folder, capture_output=True, text=True, check=True
    )
    return told.stdout.strip()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        work(*sys.argv[2:])
    else:
        main()
