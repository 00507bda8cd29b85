"""What our choices are worth: `python bench/choices.py [cpu|cuda:0]` prints the rows of docs/benchmarks.md.

Medians in one process, one after the other, so that only their ratios mean anything on a shared machine.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from statistics import median

import numpy as np
import warp as wp
import warp.sparse

from warpbrain.cases.shipped import find_case
from warpbrain.mesh import TetMesh
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

DEVICE = sys.argv[1] if len(sys.argv) > 1 else "cpu"
STEPS = 20


def milliseconds(work: Callable[[], object], repeats: int = 40, of: Callable[[list[float]], float] = median) -> float:
    """Wall time of some work [ms] after a first go, the median of several."""
    work()
    times = []
    for _ in range(repeats):
        wp.synchronize_device(DEVICE)
        start = time.perf_counter()
        work()
        wp.synchronize_device(DEVICE)
        times.append(1000.0 * (time.perf_counter() - start))
    return of(times)


def step(simulator: Simulator, captured: bool = True) -> float:
    """Median time of a step [ms] over the first steps from rest."""
    if captured:
        simulator.capture()
    times = []
    for _ in range(3):
        simulator.reset()
        for _ in range(STEPS):
            wp.synchronize_device(DEVICE)
            start = time.perf_counter()
            simulator.step()
            wp.synchronize_device(DEVICE)
            times.append(1000.0 * (time.perf_counter() - start))
    return float(np.median(times[STEPS:]))


def shuffled(mesh: TetMesh) -> TetMesh:
    """The same mesh numbered at random."""
    random = np.random.default_rng(0)
    nodes, elements = random.permutation(len(mesh.points)), random.permutation(len(mesh.tetrahedra))
    number = np.empty(len(nodes), dtype=np.int32)
    number[nodes] = np.arange(len(nodes))
    sets = {name: members[nodes] for name, members in mesh.node_sets.items()}
    return TetMesh(mesh.points[nodes], number[mesh.tetrahedra[elements]], mesh.tissue[elements], sets)


def main() -> None:
    """Measure and print."""
    wp.config.log_level = wp.LOG_WARNING
    print(f"{wp.get_device(DEVICE).name} ({DEVICE}); ms")
    for name, case, tissue in (("st/coarse", "phantom", "single"), ("mt/fine", "phantom-fine", "multi")):
        found = find_case(case, tissue)
        model = model_of(found)
        system = System(model, DEVICE)
        simulator = Simulator(system)
        loops = step(simulator, captured=False)
        print(f"{name}: step, launched phase by phase {loops:.3f}; in one graph {step(simulator):.3f}")
        single = step(Simulator(System(model, DEVICE, "single")))
        print(f"{name}: step in single precision {single:.3f}")
        ours = milliseconds(lambda s=simulator, y=system: s._cg.multiply(s.v, y.increment))
        theirs = milliseconds(lambda s=simulator, y=system: warp.sparse.bsr_mv(y.matrix, s.v, y.increment))
        print(f"{name}: matrix-vector product {ours:.3f}; warp.sparse.bsr_mv {theirs:.3f}")
        random = model_of(replace(found, mesh=shuffled(found.mesh), boundaries=()))
        other = System(random, DEVICE)
        other.evaluate_tangents()
        in_order = milliseconds(lambda y=system: y.assemble(2e-6, 1.0))
        at_random = milliseconds(lambda y=other: y.assemble(2e-6, 1.0))
        print(f"{name}: assembly of the matrix {in_order:.3f}; numbered at random {at_random:.3f}")


if __name__ == "__main__":
    main()
