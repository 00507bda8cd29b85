"""`python -m warpbrain.bench`: pre-processing, each phase of a step, and the step as users get it, beside the paper's
Table 3.

Table 3 times everything from a mesh in memory to the first step. Here much of that is kept once it is made, with a
`TetMesh`, a `Case` or a `Model`, by mesh or by bytes of coordinates, because a diagnosis asks for the same mesh
thousands of times. A fresh mesh is therefore another object, and differs in content from every other: no cache by
identity or by bytes can answer for it. Warm are only kernels, compiled and loaded, and memory that a GPU's pool keeps:
that is paid once on a machine or in a process, not for a mesh.
"""

import argparse
import gc
import statistics
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.bench import command
from warpbrain.bench.table3 import MAIN_LOOP, TABLE3, Row
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.errors import SolveError
from warpbrain.kernels.module import find_device, find_precision
from warpbrain.kernels.persistent import blocks_stay
from warpbrain.mesh import TetMesh
from warpbrain.report.page import lines
from warpbrain.simulation.dynamics import PHASES, PhaseClock, Simulator, finest_tolerance
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.terminal.progress import Progress

#: The motion starts again from rest after this many steps: the phantom's load crushes its softest mesh after 50 to
#: 60 ms (see docs/phantom.md), and timing inverted elements would be worthless.
RESTART = 20
#: Bodies of which the pre-processing is measured, each on a mesh of its own.
BODIES = 10
#: Names of times beside those of the phases.
PREPROCESSING, STEP = "pre-processing", "step without instruments"


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


def measure_row(row: Row, device: str, precision: str, steps: int, warmup: int, tolerance: float) -> dict[str, Any]:
    """Measure a row: so many samples of each kind after steps that also load every kernel.

    `tolerance` is that of the linear solves, relative. Returns plain values: what was measured on what, and beside the
    paper's times [ms], by the same names, ours: of `BODIES` fresh bodies `pre-processing`, from a mesh in memory to a
    simulator, and `capture` of the step that it replays; the phases of a step with the clock stopped between them; and
    a step as users get it (`STEP`).
    """
    case = find_case(row.case, row.tissue)
    # loads every kernel, which is done once in a process and not for a mesh
    first = preprocess(case, fresh_arrays(case.mesh, 0), device, precision, tolerance)
    first.capture()
    for _ in range(max(1, warmup)):
        first.step()
    wp.synchronize_device(device)
    del first
    preprocessing, capture, simulator = measure_preprocessing(case, device, precision, tolerance, BODIES)

    def samples() -> Iterator[bool]:
        """Whether each step counts; the motion begins again when it has to."""
        for sample in range(-warmup, steps):
            if sample % RESTART == 0:
                simulator.reset()
            yield sample >= 0

    phases: dict[str, list[float]] = {name: [] for name in (*PHASES, MAIN_LOOP)}
    iterations = []
    for counts in samples():
        clock = PhaseClock(simulator.system.device)
        simulator.step(clock)
        if counts:
            for name in PHASES:
                phases[name].append(1000.0 * clock.seconds[name])
            phases[MAIN_LOOP].append(1000.0 * sum(clock.seconds.values()))
            iterations.append(_checked(simulator))

    step = []
    for counts in samples():
        wp.synchronize_device(device)
        start = time.perf_counter()
        simulator.step()
        wp.synchronize_device(device)
        if counts:
            step.append(1000.0 * (time.perf_counter() - start))
            _checked(simulator)

    system = simulator.system
    cg = sorted(iterations)[len(iterations) // 2]
    moved, launches = count(system, cg)
    return {
        "row": row.name,
        "device": f"{system.device.name} ({system.device.alias})",
        "precision": precision,
        "tolerance": simulator.tolerance,
        "nodes": system.size,
        "tetrahedra": system.elements,
        "blocks": system.matrix.nnz,
        "cg_iterations": iterations,
        "bytes_per_step": moved,
        "launches_per_step": launches,
        "milliseconds": {PREPROCESSING: preprocessing, "capture": capture, **phases, STEP: step},
        "paper_milliseconds": {PREPROCESSING: row.preprocessing, **row.phases},
    }


def preprocess(case: Case, arrays: Mapping[str, Any], device: str, precision: str, tolerance: float) -> Simulator:
    """Everything between a mesh in memory and a simulator that can take its first step."""
    model = model_of(case_of(case, arrays))
    simulator = Simulator(System(model, device, precision), tolerance=tolerance)
    wp.synchronize_device(device)
    return simulator


def measure_preprocessing(
    case: Case, device: str, precision: str, tolerance: float, bodies: int
) -> tuple[list[float], list[float], Simulator]:
    """Times [ms] of `preprocess` and of the capture of a step, each on a body that no cache has seen, and the last."""
    preprocessing, capture = [], []
    simulator: Simulator | None = None
    for number in range(1, bodies + 1):
        arrays = fresh_arrays(case.mesh, number)
        # what the last one held is given back here, not while the clock runs
        simulator = None
        gc.collect()
        start = time.perf_counter()
        simulator = preprocess(case, arrays, device, precision, tolerance)
        preprocessing.append(1000.0 * (time.perf_counter() - start))
        start = time.perf_counter()
        simulator.capture()
        wp.synchronize_device(device)
        capture.append(1000.0 * (time.perf_counter() - start))
    assert simulator is not None
    return preprocessing, capture, simulator


def _checked(simulator: Simulator) -> int:
    """CG iterations of the last step, which must have converged with every element the right way round."""
    simulator.check()
    solve = simulator.last_solve()
    if not solve.converged:
        raise SolveError(f"conjugate gradients stopped at {solve.residual:.1e}, goal {solve.tolerance:.1e}")
    return solve.iterations


def count(system: System, cg_iterations: int) -> tuple[int, int]:
    """Bytes that a step must move through memory, each array once a kernel, and kernel launches of a step.

    Gathers count what they read, not what caches save; the vectors of CG count as the kernels pass over them. On the
    CPU, where CG is one kernel, a pass counts as a launch.
    """
    real = system.precision.numpy.itemsize
    vector, block = 3 * real, 9 * real
    n, m, nnz, pairs = system.size, system.elements, system.matrix.nnz, len(system.pairs)
    elements = m * (4 + 16 + block + real + 2 * real + 4 * vector + 4 * vector + 10 * block)
    gather_forces = m * 4 * (4 + vector) + n * vector
    gather_matrix = m * 10 * (4 + block) + pairs * (8 + 4 + 8 + 2 * vector + real) + nnz * block
    multiply = nnz * (4 + block) + nnz * vector + n * (4 + vector)
    right_hand_side = 8 * n * vector
    update = 7 * n * vector
    total = elements + gather_forces + gather_matrix + multiply + right_hand_side + update
    # elements by group, gather, product, right-hand side, update
    launches = len(system.groups) + 4
    if blocks_stay(system.device):
        # the matrix once; then what blocks read of each other, four numbers a node
        total += nnz * (4 + block) + cg_iterations * (nnz * 24 + n * 32)
        return int(total), launches + 1
    # a CG iteration: product, p.Ap, x and r, preconditioner, r.r and r.z, p; on the CPU product, x and r, p
    iteration, passes = multiply + 17 * n * vector + n * block, 9
    if system.device.is_cpu:
        iteration, passes = multiply + 11 * n * vector + n * block, 3
    total += n * 2 * block + 2 * n * vector + cg_iterations * iteration + iteration
    # preconditioner and CG's start
    launches += 4 + passes + passes * cg_iterations
    return int(total), launches


#: How far a body is moved from the one before it [m]: nothing that is computed with it is any harder for that.
SHIFT = 1e-6


def fresh_arrays(mesh: TetMesh, number: int) -> dict[str, Any]:
    """Copies of the arguments of a mesh, of the same body but not the same bytes: `number` differs.

    It is how often `SHIFT` to the right the body lies, and by how many places the numbers of its elements are turned
    round: neighbours in memory stay neighbours.
    """

    def turned(values: NDArray[Any]) -> NDArray[Any]:
        return np.roll(values, number, axis=0)

    return {
        "points": mesh.points + np.array([SHIFT * number, 0.0, 0.0]),
        "tetrahedra": turned(mesh.tetrahedra),
        "tissue": turned(mesh.tissue),
        "node_sets": {name: members.copy() for name, members in mesh.node_sets.items()},
        "element_sets": {name: turned(members) for name, members in mesh.element_sets.items()},
        "element_vectors": {name: turned(vectors) for name, vectors in mesh.element_vectors.items()},
        "cut": mesh.cut.copy(),
    }


def case_of(case: Case, arrays: Mapping[str, Any]) -> Case:
    """The same case of a mesh that is checked anew."""
    return replace(case, mesh=TetMesh(**arrays))
