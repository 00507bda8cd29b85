"""`warpbrain run` of a case with a specimen: simulate its tests, print and write how far they are from the records."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from warpbrain.cases.case import Case
from warpbrain.cli.log import note_device
from warpbrain.errors import InputError
from warpbrain.report import specimen as text
from warpbrain.report.comparison import describe_comparisons
from warpbrain.report.files import write_summary
from warpbrain.report.page import lines
from warpbrain.report.run_page import write_specimen_page
from warpbrain.report.summary import describe_opening, machine
from warpbrain.simulation.observation import Observed
from warpbrain.simulation.specimen import SHOWN, SpecimenRunning
from warpbrain.terminal.progress import Progress
from warpbrain.terminal.record import Record
from warpbrain.terminal.result_folder import results_in


def run(options: argparse.Namespace, case: Case, out: Path, prior: dict[str, Any] | None) -> None:
    """Simulate every test of a case with a specimen, as the options of `warpbrain run` change it; `prior` is what is to
    be said of laws that the generative model gave."""
    _check(options, case)

    record: Record = options.record
    say = record.say
    running = SpecimenRunning(case, options.tolerance, options.elements, options.device, options.precision)
    rig = running.rig
    system = rig.system
    in_time = any(rig.follows_time(recording) for recording in running.tests)
    described = text.describe_specimen(case, rig.specimen, system.model, in_time, rig.chosen)
    say(*lines("run.txt", "specimen", described, prior), sep="\n")
    note_device(record, case, system, options.precision)

    seconds = {"pre-processing": system.seconds, "loading kernels": system.load_kernels()}
    with Progress("tests", options.quiet) as progress:
        done = running.run(progress.show).tests
    seconds |= rig.solver.clock.seconds
    say(*lines("run.txt", "tests", done, SHOWN), sep="\n")
    say(*lines("run.txt", "times", seconds, rig.solver.clock.counts), sep="\n")

    [subtitle] = lines("run.txt", "subtitle_of_tests", rig.specimen.grips, system.model)
    summary = {
        **describe_opening(case, described, prior, system, options.precision),
        "solution": {"kind": "tests", "tolerance": rig.solver.tolerance, "tests": text.describe_tests(done)},
        "recordings": describe_comparisons(Observed(tuple(test.comparison for test in done), ())),
        "seconds_by_phase": seconds,
        "calls_by_phase": rig.solver.clock.counts,
        "versions": machine(),
    }
    with results_in(out, record, options.overwrite):
        text.write_tests_picture(out / "tests.png", done, case.title, subtitle)
        text.write_tests(out / "comparison.csv", done)
        write_summary(out / "summary.json", summary)
        write_specimen_page(out / "report.html", summary, done)
        record.files += ["summary.json", "comparison.csv", "tests.png", "report.html"]


def _check(options: argparse.Namespace, case: Case) -> None:
    """Refuse options that mean nothing for a specimen."""
    if options.mesh_error is not None:
        raise InputError(
            f"--mesh-error: {case.path} has a [specimen], which has no one state: compare --elements tet4-averaged"
        )
    for option, asked_of in (("--steps", options.steps), ("--to-rest", options.to_rest), ("--until", options.until)):
        if asked_of:
            raise InputError(
                f"{option}: {case.path} has a [specimen], whose tests are quasi-static: there is no motion"
            )
    if options.elements in ("tet10", "tet10-mixed"):
        tests = "whose tests have linear elements only"
        raise InputError(f"--elements {options.elements}: {case.path} has a [specimen], {tests}")
