"""`python -m warpbrain.bench ensemble`: how fast batches are, and what they gain over single runs.

The time of a step and sample over the size of a batch, and the gain of several processes.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import warp as wp

from warpbrain.bench import command
from warpbrain.cases.shipped import find_case
from warpbrain.ensemble.batch import parts_of_clusters
from warpbrain.ensemble.course import step_batch
from warpbrain.ensemble.run import chosen_samples
from warpbrain.ensemble.workers import Here, Job, Processes, bytes_per_slot
from warpbrain.kernels.batched.layout import TANGENT
from warpbrain.kernels.module import find_device
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.terminal.progress import Progress
from warpbrain.terminal.quiet import start_warp_quietly

#: Steps of a motion from rest, as many as the bench of a single run takes before it starts again.
STEPS = 20
#: Motions of which the fastest counts.
REPEATS = 3


def bench(options: argparse.Namespace) -> None:
    """Measure and print."""
    batches = None if options.batches is None else command.numbers("--batches", options.batches)
    processes = [] if options.processes is None else command.numbers("--processes", options.processes)
    versions, device = command.start(options), find_device(options.device)
    if batches is None:
        batches = [1, 4, 16, 32, 64, 128, 256, 512] if device.is_cuda else [1, 2, 4, 8]
    command.say("ensemble", device, options.precision, STEPS, command.release(versions))
    written: dict[str, Any] = {"versions": versions, "device": device.name, "precision": options.precision}
    progress = Progress("bench")
    progress.show(0.0, "single runs")
    single = measure_single(device.alias, options.precision)
    progress.clear()
    command.say("single", single)
    written |= {"single_milliseconds": single, "batches": []}
    for measured in measure_batches(batches, device.alias, options.precision):
        command.say("batch", measured, single)
        written["batches"].append(measured)
    rates: dict[str, float] = {}
    for count in processes:
        progress.show(0.5, f"{count} processes")
        rates[str(count)] = rate = measure_processes(count, options.samples, options.precision)
        progress.clear()
        command.say("processes", count, rate, next(iter(rates.values())))
    written["samples_a_second_by_processes"] = rates
    if options.sweep is not None:
        progress.show(0.9, "sweep")
        written["sweep"] = measure_sweep(options.sweep, device.alias, options.precision)
        progress.clear()
        command.say("sweep", options.sweep, written["sweep"])
    command.write(options.json, written)


def phantom_job(count: int, precision: str) -> Job:
    """Motions of the coarse phantom of one tissue, with the laws of the first draws of its prior."""
    case = find_case("phantom", "single")
    samples = chosen_samples(case, count)
    return Job(model_of(case), tuple(samples), steps=STEPS, precision=precision)


def measure_batches(sizes: list[int], device: str, precision: str) -> Iterator[dict[str, Any]]:
    """Measure motions of as many samples as a batch has slots, for each size.

    `milliseconds` are of a step and sample, for each motion, `cg_iterations` the mean over all steps; `bytes_per_step`
    are of a step and sample, each array counted once a kernel, and `memory` [bytes] of the batch.
    """
    job = phantom_job(max(sizes), precision)
    system = job.system(device)
    for slots in sizes:
        samples = sorted(job.samples[:slots], key=lambda sample: sample.stiffness)
        numbers = [sample.number for sample in samples]
        course = job.course()
        batch = course.batch_of(system, samples, slots)
        # loads kernels and captures the graph
        list(step_batch(batch, course, numbers))
        times = []
        for _ in range(REPEATS):
            wp.synchronize_device(system.device)
            start = time.perf_counter()
            outcomes = [outcome for ended in step_batch(batch, course, numbers) for outcome in ended]
            seconds = time.perf_counter() - start
            steps = sum(outcome.steps for outcome in outcomes)
            times.append(1000.0 * seconds / steps)
        iterations = sum(outcome.cg_iterations for outcome in outcomes) / steps
        yield {
            "slots": slots,
            "samples": len(outcomes),
            "failed": sum(outcome.failed for outcome in outcomes),
            "milliseconds": times,
            "cg_iterations": iterations,
            "bytes_per_step": count_bytes(system, iterations),
            "memory": slots * bytes_per_slot(system),
        }
        del batch, course


def measure_single(device: str, precision: str) -> float:
    """Least time of a step [ms] of single runs with the laws of the same draws, as `Simulator` captures them."""
    job = phantom_job(3, precision)
    best = []
    for sample in job.samples:
        assert sample.materials is not None
        simulator = Simulator(System(replace(job.model, materials=sample.materials), device, precision))
        simulator.capture()
        simulator.reset()
        wp.synchronize_device(device)
        start = time.perf_counter()
        for _ in range(STEPS):
            simulator.step()
        wp.synchronize_device(device)
        best.append(1000.0 * (time.perf_counter() - start) / STEPS)
    return sum(best) / len(best)


def measure_processes(count: int, samples: int, precision: str) -> float:
    """Samples a second that `count` processes on the CPU compute, from the first results to the last."""
    job = phantom_job(samples, precision)
    done, first, start = 0, 0, 0.0
    for ended in Processes(count, None, start_warp_quietly).outcomes(job):
        done += len(ended)
        if not first:
            # processes have started and loaded their kernels
            first, start = done, time.perf_counter()
    return (done - first) / (time.perf_counter() - start)


def measure_sweep(tissue: str, device: str, precision: str) -> dict[str, float]:
    """The paper's sweep on the coarse phantom, to rest: seconds, samples, how many failed, and CG iterations."""
    case = find_case("phantom", tissue)
    job = Job(model_of(case), tuple(chosen_samples(case, "grid")), precision=precision)
    start = time.perf_counter()
    outcomes = [outcome for ended in Here(device, None).outcomes(job) for outcome in ended]
    seconds = time.perf_counter() - start
    failed, iterations = sum(o.failed for o in outcomes), sum(o.cg_iterations for o in outcomes)
    return {"seconds": seconds, "samples": len(outcomes), "failed": failed, "cg_iterations": iterations}


def count_bytes(system: System, cg_iterations: float) -> int:
    """Bytes that a step of one sample must move through memory, each array of samples counted once a kernel.

    The mesh's own arrays, which all samples share, are left out.
    """
    n, m, pairs = system.size, system.elements, len(system.pairs)
    vector, inverse = 3 * n, 6 * n
    blocks, forces, matrix = TANGENT * m, 12 * m, 9 * pairs
    # of elements and of the balance, u apart: it goes by here, and twice each with the right-hand side and the update
    evaluation = forces + m + forces + vector + m
    real, displacements = system.precision.numpy.itemsize, 8 * 5 * vector
    if parts_of_clusters(system) is not None:
        # tangents stay on the chip, a solve reads the matrix once, and its iterations stay there, too; right-hand side
        moved = evaluation + matrix + 5 * vector + (matrix + 4 * vector) + 4 * vector
        # u once more, for the tangents
        return int(displacements + 8 * vector + real * moved)
    evaluation += blocks
    beginning = blocks + matrix + 5 * vector
    # preconditioner, start
    beginning += (3 * vector + inverse) + (2 * matrix + 6 * vector + inverse)
    product = matrix + 2 * vector
    iteration = product + (7 * vector + inverse) + 3 * vector
    return int(displacements + real * (evaluation + beginning + cg_iterations * iteration + 4 * vector))
