"""`python -m warpbrain.bench threads`: a step and an equilibrium on the CPU by the number of threads."""

import argparse
import math
import os
import time
from collections.abc import Callable, Sequence
from hashlib import sha256
from statistics import median
from unittest.mock import patch

from warpbrain.bench import command
from warpbrain.bench.table3 import TABLE3, Row
from warpbrain.cases.shipped import find_case
from warpbrain.errors import InputError
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.threads import MOST, processors

#: Counts that are measured if none are named, as far as there are processors.
COUNTS = (1, 2, 4, 8, 16)
#: Steps from rest in a turn; the first turn of each count is not counted. Counts take turns, so that what else the
#: machine has to do is shared alike.
STEPS = 20


def bench(options: argparse.Namespace) -> None:
    """Measure and print."""
    if options.row not in TABLE3:
        raise InputError(f"--row {options.row}: expected one of {', '.join(TABLE3)}")
    usual = [n for n in COUNTS if n <= processors()]
    counts = usual if options.counts is None else command.numbers("--counts", options.counts, MOST)

    versions, where = command.start(options), command.host()
    command.say("threads", where["processor"], processors(), options.turns)
    measured = []
    for name, turn in (("a step", _steps(TABLE3[options.row])), ("equilibrium of 0529", _equilibria())):
        milliseconds, worked = _in_turns(turn, counts, options.turns)
        medians = {count: median(samples) for count, samples in milliseconds.items()}
        command.say("turns", name, medians, worked)
        measured.append({"what": name, "milliseconds": milliseconds, "medians": medians, "processor": worked})
    command.write(options.json, {"versions": versions, "host": where, "row": options.row, "measured": measured})


def _in_turns(
    turn: Callable[[], tuple[list[float], bytes]], counts: Sequence[int], turns: int
) -> tuple[dict[int, list[float]], dict[int, float]]:
    """Samples [ms] of each count, and the least processor time of a turn for each [ms]; all must answer the same."""
    samples: dict[int, list[float]] = {count: [] for count in counts}
    worked = dict.fromkeys(counts, math.inf)
    answers = set()
    for number in range(turns + 1):
        for count in counts:
            with patch.dict(os.environ, OMP_NUM_THREADS=str(count)):
                start = time.process_time()
                milliseconds, answer = turn()
                worked[count] = min(worked[count], 1000.0 * (time.process_time() - start) / len(milliseconds))
            answers.add(sha256(answer).hexdigest())
            if number:
                samples[count] += milliseconds
    if len(answers) > 1:
        raise AssertionError(f"{len(answers)} different answers by the number of threads")
    return samples, worked


def _steps(row: Row) -> Callable[[], tuple[list[float], bytes]]:
    """Steps from rest, each captured in a graph for the threads that there are."""
    simulator = Simulator(System(model_of(find_case(row.case, row.tissue)), "cpu"))

    def turn() -> tuple[list[float], bytes]:
        simulator.reset()
        simulator.capture()
        samples = []
        for _ in range(STEPS):
            start = time.perf_counter()
            simulator.step()
            samples.append(1000.0 * (time.perf_counter() - start))
        simulator.check()
        return samples, simulator.system.u.numpy().tobytes()

    return turn


def _equilibria() -> Callable[[], tuple[list[float], bytes]]:
    system = System(model_of(find_case("0529", "multi")), "cpu")

    def turn() -> tuple[list[float], bytes]:
        start = time.perf_counter()
        u = solve_equilibrium(system).u
        return [1000.0 * (time.perf_counter() - start)], u.tobytes()

    return turn
