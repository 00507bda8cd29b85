"""`warpbrain run` after its kernels are begun: simulate a case, print what happened and write it."""

import argparse
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from warpbrain.atomic import safe_name
from warpbrain.cases.assuming import assume
from warpbrain.cases.case import Case
from warpbrain.cases.drawn import FromPrior, with_prior_draw, with_prior_middle
from warpbrain.cases.shipped import find_case
from warpbrain.cli import warp
from warpbrain.cli.log import drawn, note_device
from warpbrain.errors import InputError, SolveError
from warpbrain.gp.trained import find_model
from warpbrain.kernels.module import is_compiling
from warpbrain.physics.laws.stability import UnstableLawError, require_stable
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.report import specimen, views
from warpbrain.report import summary as tables
from warpbrain.report.comparison import describe_comparisons, describe_mesh_error, recorded_rows, write_comparisons
from warpbrain.report.files import read_state, write_result, write_summary
from warpbrain.report.page import lines
from warpbrain.report.rendering import render_nothing
from warpbrain.report.run_page import write_run_page, write_specimen_page
from warpbrain.simulation.equilibrium import NewtonStep
from warpbrain.simulation.mesh_error import MeshError, mesh_error, observe_without
from warpbrain.simulation.observation import Observed, observe
from warpbrain.simulation.relaxation import RelaxationStep
from warpbrain.simulation.result import nodal_state_of
from warpbrain.simulation.run import Course, Run, Running, Watching
from warpbrain.simulation.specimen import SHOWN, SpecimenRunning
from warpbrain.simulation.system import System
from warpbrain.terminal.progress import Progress
from warpbrain.terminal.record import Record
from warpbrain.terminal.result_folder import choose_folder, results_in

#: Newton iterations that are printed one by one.
_LONG_HISTORY = 16


def run_case(options: argparse.Namespace) -> None:
    """Simulate a case, a body or a specimen, print what happened and write it."""
    to_warp = warp.requested(options)
    case, prior = _case(options)
    warp.check_place(to_warp, case)
    out = choose_folder(options.out, f"warpbrain-{safe_name(case.name)}-{options.tissue}", options.overwrite)
    if case.specimen is not None:
        render_nothing()
        _run_tests(options, case, out, prior)
        return

    record: Record = options.record
    say = record.say
    course = Course(options.steps, options.to_rest, options.until, options.tolerance, options.time_step)
    needed_by = () if options.mesh_error is None else ("--mesh-error",)
    elements, why = options.elements, None
    if elements is None and options.mesh_error == "elements":
        elements, why = "tet4", "--mesh-error elements is about them"
    running = Running(case, course, elements, options.device, options.precision, needed_by)
    system = running.system
    system.begin_loading_kernels()
    described = tables.describe_case(case, running.model, why or running.chosen)
    say(*lines("run.txt", "case", described, prior and tables.describe_prior(prior), tables.STAND_IN))
    note_device(record, case, system, options.precision)

    with Progress("kernels", options.quiet) as loading:
        loading.show(0.0, "the first run on a machine compiles them")
        if is_compiling():
            # what figures are made with, while there is nothing else to do
            import matplotlib.backends.backend_agg
            import matplotlib.figure  # noqa: F401
        loaded = system.load_kernels()
    with watching(options, say) as watched:
        done = running.run(watched)
    followed = done.followed
    say(*lines("run.txt", "ending", followed.solution))
    first_step = followed.begun - record.clock
    seconds = {"pre-processing": system.seconds, "loading kernels": loaded, **followed.seconds}
    displacements, compared = tables.describe_result(done.result), describe_comparisons(done.observed)
    say(*lines("run.txt", "displacement", displacements, tables.displacement_rows(displacements)))
    say(*lines("run.txt", "recordings", compared, recorded_rows(compared["compared"]), options.legacy_rmse))
    estimated, doubt = (None, None) if options.mesh_error is None else _mesh_error(options, system, done)
    if doubt is not None:
        say("", *lines("run.txt", "mesh_error", doubt))
    say(*lines("run.txt", "times", seconds, followed.calls))

    summary = {
        **tables.describe_opening(case, described, prior, system, options.precision),
        "solution": followed.solution,
        "result": displacements,
        "recordings": compared,
        **({} if doubt is None else {"mesh_error": doubt}),
        "seconds_by_phase": seconds,
        "calls_by_phase": followed.calls,
        "seconds_to_first_step": first_step,
        "versions": tables.machine(),
    }
    with results_in(out, record, options.overwrite):
        write_result(out / "result.vtu", done.result, None if estimated is None else estimated.u)
        record.files += ["result.vtu", "summary.json", *drawn(write_run_page(out, summary, done), say)]
        if done.observed.comparisons:
            write_comparisons(out / "comparison.csv", case, done.observed)
            record.files.append("comparison.csv")
        # after all that it speaks of: whoever finds it finds the others
        write_summary(out / "summary.json", summary)
        if to_warp is not None:
            warp.warp(read_state(out / "result.vtu"), out, to_warp, record, options.quiet)


def _run_tests(options: argparse.Namespace, case: Case, out: Path, prior: FromPrior | None) -> None:
    """Simulate every test of a case with a specimen, as the options of `warpbrain run` change it; `prior` says which of
    its laws are the generative model's. Refuses options that mean nothing for tests."""
    has = f"{case.path} has a [specimen]"
    if options.mesh_error is not None:
        raise InputError(f"--mesh-error: {has}, which has no one state: compare --elements tet4-averaged")
    if options.legacy_rmse:
        raise InputError(f"--legacy-rmse: {has}, whose tests record no positions")
    for option, asked_of in (("--steps", options.steps), ("--to-rest", options.to_rest), ("--until", options.until)):
        if asked_of:
            raise InputError(f"{option}: {has}, whose tests are quasi-static: there is no motion")
    if options.elements in ("tet10", "tet10-mixed"):
        raise InputError(f"--elements {options.elements}: {has}, whose tests have linear elements only")

    record: Record = options.record
    say = record.say
    running = SpecimenRunning(case, options.tolerance, options.elements, options.device, options.precision)
    rig = running.rig
    system = rig.system
    in_time = any(rig.follows_time(recording) for recording in running.tests)
    described = specimen.describe_specimen(case, rig.specimen, system.model, in_time, rig.chosen)
    say(*lines("run.txt", "specimen", described, prior and tables.describe_prior(prior)))
    note_device(record, case, system, options.precision)

    seconds = {"pre-processing": system.seconds, "loading kernels": system.load_kernels()}
    with Progress("tests", options.quiet) as progress:
        done = running.run(progress.show).tests
    seconds |= rig.solver.clock.seconds
    say(*lines("run.txt", "tests", done, SHOWN))
    say(*lines("run.txt", "times", seconds, rig.solver.clock.counts))

    [subtitle] = lines("run.txt", "subtitle_of_tests", rig.specimen.grips, system.model)
    summary = {
        **tables.describe_opening(case, described, prior, system, options.precision),
        "solution": {"kind": "tests", "tolerance": rig.solver.tolerance, "tests": specimen.describe_tests(done)},
        "recordings": describe_comparisons(Observed(tuple(test.comparison for test in done), ())),
        "seconds_by_phase": seconds,
        "calls_by_phase": rig.solver.clock.counts,
        "versions": tables.machine(),
    }
    with results_in(out, record, options.overwrite):
        figure = specimen.tests_figure(done, specimen.COLUMNS)
        views.save(figure, out / "tests.png", f"{case.title}\n{subtitle}")
        specimen.write_tests(out / "comparison.csv", done)
        write_summary(out / "summary.json", summary)
        write_specimen_page(out / "report.html", summary, done)
        record.files += ["summary.json", "comparison.csv", "tests.png", "report.html"]


def _case(options: argparse.Namespace) -> tuple[Case, FromPrior | None]:
    """The case as the arguments change it, and which of its laws are the generative model's, if any."""
    case = find_case(options.case, options.tissue)
    if options.model is not None:
        case = case.with_law(options.model)
    moduli = options.moduli
    try:
        case = case.with_shear_moduli(dict.fromkeys(case.tissues, moduli[None]) if None in moduli else moduli)
    except InputError as error:
        raise InputError(f"--{error}") from None
    if options.poisson is not None:
        case = replace(case, poisson=options.poisson)
    said: dict[str, str] = {}
    for text in options.assumed:
        kind = text.partition(":")[0]
        if kind in said and not mechanisms()[kind].several:
            raise InputError(f"--with {text}: a second {kind}, beside {said[kind]}")
        case, said[kind] = assume(case, text), text
    prior = None
    if options.sample is not None or any(tissue.law is None for tissue in case.tissues.values()):
        model = find_model(options.gp or "hierarchical")
        if options.sample is None:
            prior = with_prior_middle(case, model)
        else:
            prior = with_prior_draw(case, options.sample, options.seed or 0, model)
        case = prior.case
    elif options.gp is not None:
        raise InputError(f'--gp {options.gp}: means nothing without --sample or a tissue of mu = "prior"')
    if not options.allow_unstable:
        for label, tissue in sorted(case.tissues.items()):
            try:
                require_stable(tissue.known_law, case.poisson, tissue.formulation)
            except UnstableLawError as error:
                raise UnstableLawError(
                    f"{case.path}: [tissue.{label}] {error}; --allow-unstable computes with it all the same"
                ) from None
    return case, prior


def _mesh_error(options: argparse.Namespace, system: System, done: Run) -> tuple[MeshError | None, dict[str, Any]]:
    """The error of the mesh, if it can be estimated, and what is to be said of it."""
    settings = {"smaller": options.mesh_error == "size", "steps": options.steps, "device": options.device}
    try:
        with Progress("mesh error", options.quiet) as progress:
            estimated = mesh_error(done.case, system.model, done.result, **settings, on_share=progress.show)
    except SolveError as error:
        # the run itself is sound
        return None, {"unknown": str(error)}
    time = done.followed.solution.get("time_s")
    without = observe_without(done.case, done.result, estimated, time)
    # of a motion the error is that of its end
    at_end = done.observed if time is None else observe(done.case, nodal_state_of(system, time), time)
    return estimated, describe_mesh_error(estimated, system.model.elements, at_end, without)


@contextmanager
def watching(options: argparse.Namespace, say: Callable[..., None]) -> Iterator[Watching]:
    """Who is told of the steps, after the head of their table is printed."""
    if options.until is not None:
        name = "slow change"
    elif options.steps is not None:
        name = "motion"
    else:
        name = "to rest" if options.to_rest else "equilibrium"
    say(*lines("run.txt", "steps", name))
    count = 0
    length = 0.0

    def on_newton(step: NewtonStep) -> None:
        nonlocal count
        count += 1
        # a long history is told by its load steps, not by every iteration
        if count <= _LONG_HISTORY or step.iteration == 1:
            row("newton_step", step, count == _LONG_HISTORY)
        progress.show(step.load, f"Newton {step.iteration}")

    def on_relaxation(step: RelaxationStep) -> None:
        nonlocal count, length
        count, length = 0 if step.time_step != length else count + 1, step.time_step
        # of steps of one length, which there are many of, one in fifty
        if count % 50 == 0:
            row("step_to_rest", step)
        decades = math.log10(max(step.residual, 1e-300)) / math.log10(options.tolerance)
        progress.show(min(1.0, max(0.0, decades)), f"{step.time:.3g} s")

    def on_motion(number: int, time: float, noted: dict[str, Any] | None) -> None:
        if noted is not None:
            row("step_of_motion", noted)
        progress.show(number / options.steps, f"{1000 * time:.0f} ms")

    def on_moment(number: int, moments: int, noted: dict[str, Any]) -> None:
        if number % max(1, moments // 10) == 0 or number == moments:
            row("slow_step", noted)
        progress.show(number / moments, f"{noted['time_s']:.3g} s")

    def on_slow_newton(part: float, step: NewtonStep) -> None:
        progress.show(part, f"Newton {step.iteration}")

    def row(macro: str, *values: Any) -> None:
        progress.clear()
        say(*lines("run.txt", macro, *values))

    with Progress(name, options.quiet) as progress:
        yield Watching(on_newton, on_relaxation, on_motion, on_slow_newton, on_moment)
