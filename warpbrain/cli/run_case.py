"""`warpbrain run` after its kernels are begun: simulate a case, print what happened and write it."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from warpbrain.atomic import safe_name
from warpbrain.cases.assuming import assume
from warpbrain.cases.case import Case
from warpbrain.cases.drawn import FromPrior, with_prior_draw, with_prior_middle
from warpbrain.cases.shipped import find_case
from warpbrain.cli import run_specimen, warp
from warpbrain.cli.log import drawn, note_device
from warpbrain.errors import InputError, SolveError
from warpbrain.gp.trained import find_model
from warpbrain.kernels.module import is_compiling
from warpbrain.physics.laws.stability import UnstableLawError, require_stable
from warpbrain.report import summary as tables
from warpbrain.report import views
from warpbrain.report.comparison import describe_comparisons, describe_mesh_error, recorded_rows, write_comparisons
from warpbrain.report.files import read_state, write_result, write_summary
from warpbrain.report.page import lines
from warpbrain.report.rendering import render_nothing
from warpbrain.report.run_page import write_run_page
from warpbrain.report.summary import describe_prior
from warpbrain.report.warped import WarpRequest
from warpbrain.simulation.equilibrium import NewtonStep
from warpbrain.simulation.mesh_error import MeshError, mesh_error, observe_without
from warpbrain.simulation.observation import Observed, observe
from warpbrain.simulation.relaxation import RelaxationStep
from warpbrain.simulation.result import Result, nodal_state_of
from warpbrain.simulation.run import Course, Running, Watching
from warpbrain.simulation.system import System
from warpbrain.terminal.progress import Progress
from warpbrain.terminal.record import Record
from warpbrain.terminal.result_folder import choose_folder, results_in

#: Newton iterations that are printed one by one.
_LONG_HISTORY = 16


def run_case(options: argparse.Namespace) -> None:
    """Simulate a case, a body or a specimen, print what happened and write it."""
    to_warp = warp.requested(options)
    case, drawn_laws = _case(options)
    warp.check_place(to_warp, case)
    out = choose_folder(options.out, f"warpbrain-{safe_name(case.name)}-{options.tissue}", options.overwrite)
    prior = None if drawn_laws is None else describe_prior(drawn_laws)
    if case.specimen is not None:
        render_nothing()
        run_specimen.run(options, case, out, prior)
        return
    _run_body(options, case, out, prior, to_warp)


def _run_body(
    options: argparse.Namespace, case: Case, out: Path, prior: dict[str, Any] | None, to_warp: WarpRequest | None
) -> None:
    record: Record = options.record
    say = record.say
    needed_by = () if options.mesh_error is None else ("--mesh-error",)
    about_elements = options.elements is None and options.mesh_error == "elements"
    running = Running(
        case,
        Course(options.steps, options.to_rest, options.until, options.tolerance, options.time_step),
        "tet4" if about_elements else options.elements,
        options.device,
        options.precision,
        needed_by,
    )
    model, system = running.model, running.system
    system.begin_loading_kernels()
    chosen = "--mesh-error elements is about them" if about_elements else running.chosen
    described = tables.describe_case(case, model, chosen)
    say(*lines("run.txt", "case", described, prior, tables.STAND_IN), sep="\n")
    note_device(record, case, system, options.precision)

    with Progress("kernels", options.quiet) as loading:
        loading.show(0.0, "the first run on a machine compiles them")
        if is_compiling():
            views.load_libraries()
        loaded = system.load_kernels()
    with watching(options, say) as watched:
        done = running.run(watched)
    for line in lines("run.txt", "ending", done.followed.solution):
        say(line)
    outcome, counts = done.followed.solution, done.followed.calls
    first_step = done.followed.begun - record.clock
    seconds = {"pre-processing": system.seconds, "loading kernels": loaded, **done.followed.seconds}
    result, observed = done.result, done.observed
    displacements = tables.describe_result(result)
    compared = describe_comparisons(observed)
    say(*lines("run.txt", "displacement", displacements, tables.displacement_rows(displacements)), sep="\n")
    for line in lines("run.txt", "recordings", compared, recorded_rows(compared["compared"]), options.legacy_rmse):
        say(line)
    estimated, doubt = _mesh_error(options, case, system, result, observed, outcome)
    if doubt is not None:
        say("", *lines("run.txt", "mesh_error", doubt), sep="\n")
    say(*lines("run.txt", "times", seconds, counts), sep="\n")

    summary = {
        **tables.describe_opening(case, described, prior, system, options.precision),
        "solution": outcome,
        "result": displacements,
        "recordings": compared,
        **({} if doubt is None else {"mesh_error": doubt}),
        "seconds_by_phase": seconds,
        "calls_by_phase": counts,
        "seconds_to_first_step": first_step,
        "versions": tables.machine(),
    }
    with results_in(out, record, options.overwrite):
        write_result(out / "result.vtu", result, None if estimated is None else estimated.u)
        record.files += ["result.vtu", "summary.json", *drawn(write_run_page(out, summary, done), say)]
        if observed.comparisons:
            write_comparisons(out / "comparison.csv", case, observed)
            record.files.append("comparison.csv")
        # after all that it speaks of: whoever finds it finds the others
        write_summary(out / "summary.json", summary)
        if to_warp is not None:
            warp.warp(read_state(out / "result.vtu"), out, to_warp, record, options.quiet)


def _case(options: argparse.Namespace) -> tuple[Case, FromPrior | None]:
    """The case as the arguments change it, and which of its laws are the generative model's, if any."""
    case = find_case(options.case, options.tissue)
    if options.model is not None:
        case = case.with_law(options.model)
    moduli = options.moduli
    case = case.with_shear_moduli(dict.fromkeys(case.tissues, moduli[None]) if None in moduli else moduli)
    if options.poisson is not None:
        case = replace(case, poisson=options.poisson)
    for text in options.assumed:
        case = assume(case, text)
    prior = _from_prior(options, case)
    if prior is not None:
        case = prior.case
    if not options.allow_unstable:
        for label, tissue in sorted(case.tissues.items()):
            try:
                require_stable(tissue.known_law, case.poisson, tissue.formulation)
            except UnstableLawError as error:
                raise UnstableLawError(
                    f"{case.path}: [tissue.{label}] {error}; --allow-unstable computes with it all the same"
                ) from None
    return case, prior


def _from_prior(options: argparse.Namespace, case: Case) -> FromPrior | None:
    """The case with the laws that the generative model is to give; None if it is to give none."""
    if options.sample is None and all(tissue.law is not None for tissue in case.tissues.values()):
        if options.gp is not None:
            raise InputError(f'--gp {options.gp}: means nothing without --sample or a tissue of mu = "prior"')
        return None

    model = find_model(options.gp or "hierarchical")
    if options.sample is None:
        return with_prior_middle(case, model)
    return with_prior_draw(case, options.sample, options.seed or 0, model)


def _mesh_error(
    options: argparse.Namespace,
    case: Case,
    system: System,
    result: Result,
    observed: Observed,
    outcome: Mapping[str, Any],
) -> tuple[MeshError | None, dict[str, Any] | None]:
    """The error of the mesh and what is to be said of it; nothing, if it was not asked for, no error if not found."""
    if options.mesh_error is None:
        return None, None

    smaller = options.mesh_error == "size"
    try:
        with Progress("mesh error", options.quiet) as progress:
            estimated_error = mesh_error(
                case,
                system.model,
                result,
                smaller=smaller,
                steps=options.steps,
                device=options.device,
                on_share=progress.show,
            )
    except SolveError as error:
        # the run itself is sound
        return None, {"unknown": str(error)}
    time = outcome.get("time_s")
    without = observe_without(case, result, estimated_error, time)
    # of a motion the error is that of its end
    at_end = observed if time is None else observe(case, nodal_state_of(system, time), time)
    return estimated_error, describe_mesh_error(estimated_error, system.model.elements, at_end, without)


@contextmanager
def watching(options: argparse.Namespace, say: Callable[..., None]) -> Iterator[Watching]:
    """Who is told of the steps, after the head of their table is printed."""
    if options.until is not None:
        name = "slow change"
    elif options.steps is not None:
        name = "motion"
    else:
        name = "to rest" if options.to_rest else "equilibrium"
    say(*lines("run.txt", "steps", name), sep="\n")
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
        say(*lines("run.txt", macro, *values), sep="\n")

    with Progress(name, options.quiet) as progress:
        yield Watching(on_newton, on_relaxation, on_motion, on_slow_newton, on_moment)
