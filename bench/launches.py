"""Where the time of a step goes: its parts, each replayed in a graph of its own.

python bench/launches.py [DEVICE]

What bounds a kernel says NVIDIA's profiler, `ncu --section SpeedOfLight --section SchedulerStats python
bench/launches.py`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import warp as wp

from warpbrain.bench.table3 import TABLE3
from warpbrain.cases.shipped import find_case
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

#: Steps from rest, after which the parts are timed; launches in a graph; and replays of which the fastest counts.
STEPS, LAUNCHES, REPLAYS = 10, 50, 5


def microseconds(part: Callable[[], None], device: wp.Device) -> float:
    """Time of a part of a step, without the way from the host."""
    part()
    with wp.ScopedCapture(device=device) as capture:
        for _ in range(LAUNCHES):
            part()
    seconds = []
    for _ in range(REPLAYS):
        wp.synchronize_device(device)
        start = time.perf_counter()
        wp.capture_launch(capture.graph)
        wp.synchronize_device(device)
        seconds.append(time.perf_counter() - start)
    return 1e6 * min(seconds) / LAUNCHES


def main() -> None:
    """Print a line for each row of Table 3."""
    device = wp.get_device(sys.argv[1] if len(sys.argv) > 1 else "cuda:0")
    print(f"{device.name}, microseconds")
    for row in TABLE3.values():
        simulator = Simulator(System(model_of(find_case(row.case, row.tissue)), device.alias))
        for _ in range(STEPS):
            simulator.step()
        system, h = simulator.system, simulator.time_step
        elements = microseconds(simulator.internal_forces, device)
        matrix = microseconds(lambda system=system, h=h: system.assemble(h * h, 1.0), device)
        assembly = microseconds(simulator.assemble_system, device)

        def solve(simulator: Simulator = simulator, system: System = system) -> None:
            system.solution.zero_()
            simulator.solve_system()

        solution = microseconds(solve, device)
        iterations = simulator.last_solve().iterations
        print(
            f"{row.name}: elements {elements:.1f}, assembly {assembly:.1f} (its matrix {matrix:.1f}), "
            f"conjugate gradients {solution:.1f} for {iterations} iterations",
            flush=True,
        )


if __name__ == "__main__":
    main()
