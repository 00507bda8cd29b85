"""`warpbrain ensemble`: many samples of a case as one batched simulation, resumed where it was left."""

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from warpbrain.atomic import safe_name
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.cli.log import note_case
from warpbrain.ensemble.results import results_of
from warpbrain.ensemble.run import SAMPLES, chosen_samples, chosen_workers, compute_missing, overloaded
from warpbrain.ensemble.sample import Sample
from warpbrain.ensemble.store import Store, discard
from warpbrain.ensemble.workers import Job, Workers
from warpbrain.errors import InputError, SolveError
from warpbrain.gp.process import Process
from warpbrain.gp.trained import find_model
from warpbrain.report import ensemble as report
from warpbrain.report import summary as tables
from warpbrain.report.files import fingerprints, write_body, write_summary
from warpbrain.report.page import lines
from warpbrain.simulation.of_case import model_of
from warpbrain.terminal.progress import Progress
from warpbrain.terminal.quiet import start_warp_quietly
from warpbrain.terminal.record import Record
from warpbrain.terminal.result_folder import choose_folder, results_in
from warpbrain.threads import processors

#: Samples that are named one by one where something is said of many.
_NAMED = 12


def ensemble(options: argparse.Namespace) -> None:
    """Simulate many samples of a case, and go on where that was left."""
    _check(options)
    record: Record = options.record
    say = record.say

    start_warp_quietly()
    case = find_case(options.case, options.tissue)
    if case.specimen is not None:
        raise InputError(f"{case.path}: [specimen]: a specimen's tests are run one by one: see warpbrain run")
    if options.model is not None:
        case = case.with_law(options.model)
    if options.poisson is not None:
        case = replace(case, poisson=options.poisson)
    process = _process(options)
    samples, chosen = _samples(options, case, process)
    model = model_of(case)
    job = Job(model, tuple(samples), steps=options.steps, tolerance=options.tolerance, precision=options.precision)
    described = tables.describe_case(case, model)
    course = "to rest" if options.steps is None else f"{options.steps} steps of 1 ms"
    left_out, how = tables.left_out(model, "an ensemble has no others"), f"{chosen}; {course}, {options.precision}"
    say(*lines("ensemble.txt", "opening", described, left_out, len(samples), how))
    if options.steps is None:
        # what is likely to fail, before it is computed
        load = overloaded(model, samples, None if options.dask is not None else options.device)
        if load.numbers:
            say(*lines("ensemble.txt", "overloaded", load, len(samples), _NAMED))
    # the same command goes on with what is there, so its folder is that of before
    out = options.out or Path(f"warpbrain-ensemble-{safe_name(case.name)}-{options.tissue}")
    earlier = ("ensemble.json", "summary.json") if (out / "ensemble.json").exists() else ()
    choose_folder(out, "", options.overwrite, earlier)
    if options.overwrite:
        discard(out)
    processes = options.processes or processors()
    with chosen_workers(options.device, options.batch, processes, options.dask, start_warp_quietly) as workers:
        about = {"case": case.name, "samples": len(samples), "chosen": chosen, "course": course}
        note_case(record, case, workers.name)
        store = Store(out, job, workers.kind, about)
        for name in store.damaged:
            say(f"  damaged   {name}: nothing of it is used")
        seconds, computed = _compute(job, store, workers, say, Progress("samples", options.quiet))

    with Progress("summing up", options.quiet) as progress:
        to_rest, outcomes = options.steps is None, store.outcomes()
        result = results_of(case, model.mesh, samples, outcomes, to_rest, lambda n: progress.show(n / len(samples)))
    result_summary = report.describe_ensemble(result)
    say("", *report.ensemble_lines(result_summary))
    summary = {
        "case": described,
        "inputs_sha256": fingerprints(case, process),
        "chosen": chosen,
        "course": course,
        "precision": options.precision,
        "workers": workers.name,
        "result": result_summary,
        "seconds": seconds,
        "samples_computed_in_these_seconds": computed,
        "versions": tables.machine(),
    }
    with results_in(out, record, options.overwrite):
        record.files += [*report.write_table(out, report.table_of(result)), "summary.json"]
        if (fields := result.fields) is not None:
            write_body(out / "fields.vtu", report.file_of_fields(fields))
            subtitle = f"{fields.count} of {len(samples)} samples, {course}: {chosen}"
            report.write_spread_picture(out / "spread.png", fields, case.title, subtitle)
            record.files += ["fields.vtu", "spread.png"]
        write_summary(out / "summary.json", summary)
    if result.fields is None:
        raise SolveError(f"no sample of {len(samples)} has an answer; the reasons are in {out / 'samples.csv'}")


def _check(options: argparse.Namespace) -> None:
    """Refuse options that mean nothing together; reads the size of a batch."""
    if options.grid and options.seed is not None:
        raise InputError(f"--seed {options.seed}: means nothing with --grid")
    if options.dask is not None and options.processes is not None:
        raise InputError(f"--processes {options.processes}: means nothing with --dask; write local:{options.processes}")
    if options.batch == "auto":
        options.batch = None
    elif options.batch.isdecimal() and int(options.batch) > 0:
        options.batch = int(options.batch)
    else:
        raise InputError(f"--batch {options.batch}: expected auto or a whole number of at least 1")


def _process(options: argparse.Namespace) -> Process:
    """The generative model of the samples."""
    if options.grid and options.gp is None:
        return find_model("coregionalised", "as_published")
    return find_model(options.gp or "hierarchical")


def _samples(options: argparse.Namespace, case: Case, process: Process) -> tuple[list[Sample], str]:
    """The samples, and in words how they were chosen."""
    by = f"the generative model {process.name} ({process.variant})"
    if process.folder is not None:
        by += f" of {process.folder}"
    if options.grid:
        return chosen_samples(case, "grid", process=process), f"the paper's sweep by {by}"
    count, seed = options.samples or SAMPLES, options.seed or 0
    with Progress("drawing", options.quiet) as progress:
        samples = chosen_samples(case, count, seed, process, lambda n: progress.show(n / count))
    return samples, f"draws 0 to {count - 1} of seed {seed} by {by}"


def _compute(
    job: Job, store: Store, workers: Workers, say: Callable[..., None], progress: Progress
) -> tuple[float, int]:
    """Compute what the store lacks; returns the seconds that it took and how many samples they were."""
    total, there = len(job.samples), len(store.numbers())
    if there:
        say(f"  resumed   {there} of {total} samples are there, {total - there} are missing")
    if there == total:
        return 0.0, 0
    say(f"  workers   {workers.name}")
    start = time.perf_counter()

    def on_done(done: int) -> None:
        rate = done / (time.perf_counter() - start)
        left = (total - there - done) / rate
        progress.show((there + done) / total, f"{rate:.3g} a second, {_duration(left)} left")

    with progress:
        progress.show(there / total, "loading kernels; the first run on a machine compiles them")
        done = compute_missing(job, store, workers, on_done)
    seconds = time.perf_counter() - start
    say(f"  computed  {done} samples in {_duration(seconds)}, {done / seconds:.3g} a second")
    return seconds, done


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{seconds:.3g} s"
