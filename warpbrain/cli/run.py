"""`warpbrain run`: simulate a case, print what happened and write it."""

from __future__ import annotations

import argparse
import math
import textwrap
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpbrain.cli import output, run_slowly, warp
from warpbrain.errors import InputError, SolveError
from warpbrain.terminal.progress import Progress

if TYPE_CHECKING:
    from warpbrain.cases.case import Case
    from warpbrain.cases.drawn import FromPrior
    from warpbrain.simulation.mesh_error import MeshError
    from warpbrain.simulation.model import Model
    from warpbrain.simulation.observation import Observed
    from warpbrain.simulation.result import Result
    from warpbrain.simulation.system import System
    from warpbrain.terminal.record import Record


#: Newton iterations that are printed one by one.
_LONG_HISTORY = 16
#: Letters of a line of a picture's title.
_LINE = 150


def add_parser(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "run",
        help="simulate a case",
        description="Simulates a case and writes result.vtu, summary.json, deformation.png, report.html and "
        "comparison.csv. Without --steps, --to-rest or --until it finds the static equilibrium.",
    )
    add = parser.add_argument
    add(
        "--case",
        required=True,
        metavar="NAME",
        help="0529, phantom, ... (see warpbrain cases), or the path of a case folder",
    )
    add("--tissue", choices=("single", "multi"), default="multi", help="one tissue, or grey and white (default)")
    add(
        "--model",
        metavar="LAW",
        help="neo-hookean, mooney-rivlin or ogden for every tissue, at the shear modulus that the case gives "
        "(default: the case's own law)",
    )
    add("--mu", nargs="+", metavar="PA", default=[], help="shear modulus [Pa] of every tissue, or LABEL=PA for one")
    add("--sample", type=int, metavar="N", help="draw number N (from 0) of the tissues' joint prior gives every law")
    add("--seed", type=int, metavar="S", help="another sequence of draws for --sample (default: 0)")
    add(
        "--gp",
        metavar="MODEL",
        help='generative model of --sample and of mu = "prior": hierarchical (default), coregionalised or a folder',
    )
    add(
        "--with",
        dest="assumed",
        action="append",
        default=[],
        metavar="MECHANISM",
        help="assume one more mechanism, such as gravity:level=60 (see docs/mechanisms); can be given several times",
    )
    add("--poisson", type=float, metavar="NU", help="Poisson ratio of every tissue, in (-1, 0.5)")
    add(
        "--elements",
        choices=("tet4", "tet4-averaged", "tet10", "tet10-mixed"),
        help="plain tetrahedra (default up to nu = 0.49); averaged gradients, which lock less; quadratic tetrahedra, "
        "with nodes in the middle of edges; or these with a continuous linear pressure (P2-P1), which do not lock in "
        "nearly incompressible tissue (default above, where what acts allows it)",
    )
    add(
        "--mesh-error",
        nargs="?",
        choices=("elements", "size"),
        const="size",
        help="estimate the error of the mesh: 'elements', what locks, at about twice the cost of the run, or 'size' "
        "(if nothing is said), with elements of half the size too, at ten times or more",
    )
    add("--device", metavar="NAME", help="cpu, cuda:0, ... (default: the GPU if there is one, else cpu)")
    add("--precision", choices=("double", "single"), default="double", help="default: double")
    motion = parser.add_mutually_exclusive_group()
    motion.add_argument("--steps", type=int, metavar="N", help="follow the motion for N time steps of 1 ms")
    motion.add_argument("--to-rest", action="store_true", help="follow the damped motion until it is at rest")
    add(
        "--until",
        type=float,
        metavar="SECONDS",
        help="follow slow change without inertia until then, in --steps steps that grow (default: 20): for drainage "
        "and viscoelasticity",
    )
    add(
        "--tolerance",
        type=float,
        default=1e-8,
        metavar="TOL",
        help="out-of-balance force at equilibrium, relative to all nodal forces (default: 1e-8)",
    )
    add(
        "--legacy-rmse",
        action="store_true",
        help="print also what the paper's own code calls rmse, the root of the mean distance in sqrt(mm)",
    )
    add("--allow-unstable", action="store_true", help="accept a law that breaks the paper's stability conditions")
    warp.add_arguments(parser)
    output.add_arguments(parser, "warpbrain-CASE-TISSUE")
    parser.set_defaults(call=_run)


def _run(options: argparse.Namespace) -> None:
    start = time.perf_counter()
    _check(options)
    record: Record = options.record
    say = record.say

    from warpbrain.atomic import safe_name
    from warpbrain.report import summary as tables
    from warpbrain.report.comparison import comparison_lines, describe_comparisons, write_comparisons
    from warpbrain.report.files import write_result, write_summary
    from warpbrain.report.fingerprints import fingerprints
    from warpbrain.report.mesh_error import mesh_error_lines
    from warpbrain.report.prior_text import describe_prior, prior_lines
    from warpbrain.simulation.of_case import model_of
    from warpbrain.simulation.system import System, find_device
    from warpbrain.terminal.quiet import start_warp_quietly
    from warpbrain.terminal.result_folder import choose_folder, results_in

    start_warp_quietly()
    find_device(options.device)
    asked = warp.asked_for(options)
    case, found = _case(options)
    warp.check_place(asked, case)
    out = choose_folder(options.out, f"warpbrain-{safe_name(case.name)}-{options.tissue}", options.overwrite)
    prior = None if found is None else describe_prior(found)
    if case.specimen is not None:
        from warpbrain.cli import run_specimen

        run_specimen.run(options, case, out, prior)
        return
    model, chosen = _with_elements(options, model_of(case)[0])
    described = tables.describe_case(case, model, chosen)
    say(*tables.case_lines(described), *prior_lines(prior), sep="\n")
    system = System(model, options.device, options.precision)
    output.note_case(record, case, f"{system.device.name} ({system.device.alias}), {options.precision} precision")
    say(f"  device    {system.device.name} ({system.device.alias}), {options.precision} precision")

    loading = Progress("kernels", options.quiet)
    loading.show(0.0, "the first run on a machine compiles them")
    loaded = system.load_kernels()
    loading.clear()
    outcome, seconds, counts = _simulate(options, case, system, say)
    earlier = outcome.pop("states", None)
    first_step = outcome.pop("first_step") - start
    seconds = {"pre-processing": system.seconds, "loading kernels": loaded, **seconds}

    from warpbrain.simulation.observation import observe
    from warpbrain.simulation.result import nodal_state_of, result_of

    result = result_of(system, outcome.get("time_s", math.inf))
    reached = nodal_state_of(system, outcome.get("time_s", math.inf))
    if "time_s" not in outcome:
        from warpbrain.simulation.at_rest import states_at_rest

        earlier = states_at_rest(case, system, reached, options.tolerance)
    observed = observe(case, reached, outcome.get("time_s"), earlier)
    said = tables.describe_result(result)
    compared = describe_comparisons(observed)
    say("", *tables.displacement_lines(said), sep="\n")
    if case.recordings:
        say("", *comparison_lines(compared, options.legacy_rmse), sep="\n")
    estimated, doubt = _mesh_error(options, case, system, result, observed, outcome)
    if doubt is not None:
        say("", *mesh_error_lines(doubt), sep="\n")
    say("", *tables.timing_lines(seconds, counts), sep="\n")

    summary = {
        "case": described,
        "inputs_sha256": fingerprints(case),
        **({} if prior is None else {"prior": prior}),
        "device": {"name": system.device.name, "alias": system.device.alias, "precision": options.precision},
        "solution": outcome,
        "result": said,
        "recordings": compared,
        **({} if doubt is None else {"mesh_error": doubt}),
        "seconds_by_phase": seconds,
        "calls_by_phase": counts,
        "seconds_to_first_step": first_step,
        "versions": tables.machine(),
    }
    with results_in(out, record, options.overwrite):
        write_result(out / "result.vtu", result, None if estimated is None else estimated.u)
        record.files += ["result.vtu", "summary.json", *_illustrate(out, case, result, observed, summary, say)]
        if observed.comparisons:
            write_comparisons(out / "comparison.csv", case, observed)
            record.files.append("comparison.csv")
        # after all that it speaks of: whoever finds it finds the others
        write_summary(out / "summary.json", summary)
        if asked is not None:
            record.files += warp.warp(out / "result.vtu", out, asked, say, options.quiet)
        say("", f"written to {out}: {', '.join(record.files)}", sep="\n")


def _with_elements(options: argparse.Namespace, model: Model) -> tuple[Model, str | None]:
    """The model with the elements that were asked for, or with those that it needs, and why these."""
    from warpbrain.simulation.locking import choose_elements

    if options.elements is not None:
        return replace(model, elements=options.elements), None
    if options.mesh_error == "elements":
        return model, "--mesh-error elements is about them"
    choice = choose_elements(model, ("--mesh-error",) if options.mesh_error is not None else ())
    return replace(model, elements=choice.elements), choice.reason


def _check(options: argparse.Namespace) -> None:
    """Refuse bad numbers before anything heavy is imported; reads the moduli."""
    if options.steps is not None and options.steps < 1:
        raise InputError(f"--steps {options.steps}: expected a whole number of at least 1")
    if options.poisson is not None and not -1.0 < options.poisson < 0.5:
        raise InputError(f"--poisson {options.poisson:g}: expected a number in the open interval (-1, 0.5)")
    if not 0.0 < options.tolerance < 1.0:
        raise InputError(f"--tolerance {options.tolerance:g}: expected a number between 0 and 1")
    if options.mesh_error is not None and options.elements in ("tet10", "tet10-mixed"):
        raise InputError(f"--mesh-error: is not known of --elements {options.elements}: expected tet4 or tet4-averaged")
    if options.mesh_error == "elements" and options.elements == "tet4-averaged":
        raise InputError("--mesh-error elements: compares with tet4-averaged: --mesh-error size says what is left")
    run_slowly.check(options)
    options.moduli = parse_moduli(options.mu)
    for name, value in (("--sample", options.sample), ("--seed", options.seed)):
        if value is not None and value < 0:
            raise InputError(f"{name} {value}: expected a whole number of at least 0")
    if options.sample is not None and options.mu:
        raise InputError(
            f"--sample {options.sample}: gives every law; --mu {' '.join(options.mu)} means nothing with it"
        )
    if options.sample is None and options.seed is not None:
        raise InputError(f"--seed {options.seed}: means nothing without --sample")


def _case(options: argparse.Namespace) -> tuple[Case, FromPrior | None]:
    """The case as the arguments change it, and which of its laws are the generative model's, if any."""
    from warpbrain.cases.assuming import assume
    from warpbrain.cases.shipped import find_case
    from warpbrain.physics.laws.stability import UnstableLawError, require_stable

    case = find_case(options.case, options.tissue)
    if options.model is not None:
        case = case.with_law(options.model)
    every, by_label = options.moduli
    moduli: Mapping[int, float] = by_label if every is None else dict.fromkeys(case.tissues, every)
    case = case.with_shear_moduli(moduli)
    if options.poisson is not None:
        case = replace(case, poisson=options.poisson)
    for said in options.assumed:
        case = assume(case, said)
    found = _from_prior(options, case)
    if found is not None:
        case = found.case
    if not options.allow_unstable:
        for label, tissue in sorted(case.tissues.items()):
            try:
                require_stable(tissue.known_law, case.poisson, tissue.formulation)
            except UnstableLawError as error:
                raise UnstableLawError(
                    f"{case.path}: [tissue.{label}] {error}; --allow-unstable computes with it all the same"
                ) from None
    return case, found


def _from_prior(options: argparse.Namespace, case: Case) -> FromPrior | None:
    """The case with the laws that the generative model is to give; None if it is to give none."""
    if options.sample is None and all(tissue.law is not None for tissue in case.tissues.values()):
        if options.gp is not None:
            raise InputError(f'--gp {options.gp}: means nothing without --sample or a tissue of mu = "prior"')
        return None

    from warpbrain.cases.drawn import with_prior_draw, with_prior_middle
    from warpbrain.gp.trained import find_model

    model = find_model(options.gp or "hierarchical")
    if options.sample is None:
        return with_prior_middle(case, model)
    return with_prior_draw(case, options.sample, options.seed or 0, model)


def parse_moduli(values: list[str]) -> tuple[float | None, dict[int, float]]:
    """Read the values of ``--mu``: one number for every tissue, or LABEL=PA for some.

    Raises
    ------
    InputError
        If a value is neither, is not positive, or both ways are mixed.
    """
    every: float | None = None
    by_label: dict[int, float] = {}
    for value in values:
        label, equals, number = value.rpartition("=")
        try:
            mu = float(number)
            key = int(label) if equals else None
        except ValueError:
            raise InputError(f"--mu {value}: expected a number [Pa] or LABEL=PA") from None
        if not (math.isfinite(mu) and mu > 0.0):
            raise InputError(f"--mu {value}: the shear modulus must be a positive number [Pa]")
        if key is not None:
            if key in by_label:
                raise InputError(f"--mu {' '.join(values)}: tissue {key} is given twice")
            by_label[key] = mu
        elif every is None:
            every = mu
        else:
            raise InputError(f"--mu {' '.join(values)}: expected one number for every tissue, or LABEL=PA for each")
    if every is not None and by_label:
        raise InputError(f"--mu {' '.join(values)}: give one number for every tissue or LABEL=PA for some, not both")
    return every, by_label


def _simulate(
    options: argparse.Namespace, case: Case, system: System, say: Any
) -> tuple[dict[str, Any], dict[str, float], dict[str, int]]:
    """Find the state that the arguments ask for; returns what to report of it, and times and counts by phase."""
    if options.until is not None:
        return run_slowly.follow(options, case, system, say)
    if options.steps is not None:
        return _follow(options, system, say, Progress("motion", options.quiet))
    if options.to_rest:
        return _relax(options, system, say, Progress("to rest", options.quiet))
    return _balance(options, system, say, Progress("equilibrium", options.quiet))


def _balance(
    options: argparse.Namespace, system: System, say: Any, progress: Any
) -> tuple[dict[str, Any], dict[str, float], dict[str, int]]:
    from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver, NewtonStep

    say("", "equilibrium   load   Newton   residual    CG   step   min J", sep="\n")

    taken: list[NewtonStep] = []
    first: list[float] = []

    def on_step(step: NewtonStep) -> None:
        taken.append(step)
        first.append(time.perf_counter())
        # a long way is told by its load steps, not by every iteration
        if len(taken) <= _LONG_HISTORY or step.iteration == 1:
            progress.clear()
            say(
                f"            {100 * step.load:>5.1f} % {step.iteration:>6}   {step.residual:>8.1e} "
                f"{step.cg_iterations:>5}  {step.step:>5.3g}   {step.min_J:>5.3f}"
                + ("   indefinite tangent" if step.indefinite else "")
            )
        if len(taken) == _LONG_HISTORY:
            say("            (from here on, the first iteration of each load step)")
        progress.show(step.load, f"Newton {step.iteration}")

    solver = EquilibriumSolver(system, EquilibriumOptions(tolerance=options.tolerance), on_step)
    try:
        state = solver.solve()
    finally:
        progress.clear()
    if not first:
        first.append(time.perf_counter())
    say(
        f"  converged: relative out-of-balance force {state.residual:.1e} (goal {solver.tolerance:.1e}), "
        f"stored energy {1000 * state.energy:.4g} mJ"
    )
    if state.unstable_iterations:
        say(
            f"  note: the tangent was indefinite in {state.unstable_iterations} iterations; this may be another "
            "equilibrium than the one that a slowly growing load reaches first"
        )
    outcome = {
        "kind": "equilibrium",
        "first_step": first[0],
        "tolerance": solver.tolerance,
        "relative_residual": state.residual,
        "stored_energy_J": state.energy,
        "iterations_with_indefinite_tangent": state.unstable_iterations,
        "history": [vars(step) for step in state.history],
    }
    return outcome, solver.clock.seconds, solver.clock.counts


def _relax(
    options: argparse.Namespace, system: System, say: Any, progress: Any
) -> tuple[dict[str, Any], dict[str, float], dict[str, int]]:
    from warpbrain.simulation.phase_clock import PhaseClock
    from warpbrain.simulation.relaxation import RelaxationOptions, RelaxationStep, relax_to_rest

    say("", "to rest        time [s]  step [s]   residual    CG   min J", sep="\n")
    first: list[float] = []

    def on_step(step: RelaxationStep) -> None:
        first.append(time.perf_counter())
        progress.clear()
        say(
            f"            {step.time:>11.3g} {step.time_step:>9.3g}   {step.residual:>8.1e} {step.cg_iterations:>5}"
            f"   {step.min_J:>5.3f}"
        )
        decades = math.log10(max(step.residual, 1e-300)) / math.log10(options.tolerance)
        progress.show(min(1.0, max(0.0, decades)), f"{step.time:.3g} s")

    clock = PhaseClock(system.device)
    try:
        state = relax_to_rest(system, RelaxationOptions(tolerance=options.tolerance), on_step, clock)
    finally:
        progress.clear()
    say(f"  at rest: relative out-of-balance force {state.residual:.1e} (goal {state.tolerance:.1e})")
    outcome = {
        "kind": "at rest",
        "first_step": first[0],
        "tolerance": state.tolerance,
        "relative_residual": state.residual,
        "history": [vars(step) for step in state.history],
    }
    return outcome, clock.seconds, clock.counts


def _follow(
    options: argparse.Namespace, system: System, say: Any, progress: Any
) -> tuple[dict[str, Any], dict[str, float], dict[str, int]]:
    from warpbrain.simulation.dynamics import Simulator
    from warpbrain.simulation.phase_clock import PhaseClock

    simulator = Simulator(system)
    clock = PhaseClock(system.device)
    say("", "motion        time [ms]     CG   min J   kinetic energy [mJ]", sep="\n")
    every = max(1, options.steps // 10)
    history = []
    first: list[float] = []
    try:
        for step in range(1, options.steps + 1):
            # a prescribed displacement without a history of its own is reached evenly over the run
            due = simulator.time + simulator.time_step
            simulator.prescribe(system.model.prescribed_at(due, step / options.steps))
            simulator.timed_step(clock)
            min_J = simulator.check()
            first.append(time.perf_counter())
            if step % every == 0 or step == options.steps:
                kinetic, solve = simulator.kinetic_energy(), simulator.last_solve()
                history.append(
                    {"time_s": simulator.time, "cg_iterations": solve.iterations, "min_J": min_J, "kinetic_J": kinetic}
                )
                progress.clear()
                say(
                    f"            {1000 * simulator.time:>11.4g} {solve.iterations:>6}   {min_J:>5.3f}"
                    f"   {1000 * kinetic:.4g}"
                )
            progress.show(step / options.steps, f"{1000 * simulator.time:.0f} ms")
    finally:
        progress.clear()
    outcome = {
        "kind": "motion",
        "first_step": first[0],
        "time_s": simulator.time,
        "time_step_s": simulator.time / options.steps,
        "damping": vars(system.model.damping),
        "cg_tolerance": simulator.tolerance,
        "history": history,
    }
    return outcome, clock.seconds, clock.counts


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
    from warpbrain.report.mesh_error import describe_mesh_error
    from warpbrain.simulation.mesh_error import mesh_error, observe_without

    progress = Progress("mesh error", options.quiet)
    elements = system.model.elements
    try:
        found = mesh_error(
            case,
            system.model,
            result,
            smaller=options.mesh_error == "size",
            steps=options.steps,
            device=options.device,
            on_share=progress.show,
        )
    except SolveError as error:
        # the run itself is sound
        return None, {"unknown": str(error)}
    finally:
        progress.clear()
    without = observe_without(case, result, found, outcome.get("time_s"))
    return found, describe_mesh_error(found, elements, observed, without)


def _illustrate(
    out: Path, case: Case, result: Result, observed: Observed, summary: dict[str, Any], say: Callable[..., None]
) -> list[str]:
    """Write what people look at; returns the names of the files."""
    from warpbrain.report.picture import Moved, draw
    from warpbrain.report.run_page import write_run_page

    moved = Moved.of(case.recordings, observed.comparisons)
    names = {label: tissue.name for label, tissue in case.tissues.items()}
    left_out = [line for text in summary["case"]["left_out"][:1] for line in textwrap.wrap(f"Left out, {text}", _LINE)]
    lines = [_subtitle(summary["case"], summary["solution"]), *summary["recordings"]["in_words"], *left_out]
    pictures = draw(out / "deformation.png", case.mesh, result.mesh, result.u, names, moved, case.title, lines)
    write_run_page(out / "report.html", summary, result, case.mesh, moved, pictures)
    if isinstance(pictures, str):
        say("", f"deformation.png is not drawn: {pictures}", sep="\n")
        return ["report.html"]
    return ["deformation.png", "report.html"]


def _subtitle(case: Mapping[str, Any], outcome: Mapping[str, Any]) -> str:
    laws = ", ".join(f"{one['name']} {one['law']} {one['shear_modulus_Pa']:g} Pa" for one in case["tissues"].values())
    state = outcome["kind"]
    if state == "motion":
        state = f"after {1000 * outcome['time_s']:.0f} ms"
    elif state == "slow change":
        state = f"after {outcome['time_s']:g} s"
    stand_in = "stand-in, not the patient's images; " if case["origin"] == "stand-in" else ""
    return f"{stand_in}{laws}; {state}"
