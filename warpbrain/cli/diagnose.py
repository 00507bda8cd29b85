"""`warpbrain diagnose`: what was left out of a case."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpbrain.cli import warp
from warpbrain.cli.options import WARPED, add_results, add_to, note_case

if TYPE_CHECKING:
    from warpbrain.terminal.record import Record


def add_parser(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "diagnose",
        help="say what physics a case leaves out",
        description="Locates where simulation and recordings differ, names the physics that was left out, models it, "
        "and shows the fit improve on data it was not fitted to. Writes "
        "report.html, diagnosis.json, map.vtu, state.vtu, points.csv, covariance.npz and explained/.",
    )
    add = partial(add_to, parser)
    add("--case", "--tissue")
    add(
        "--candidates",
        default="all",
        metavar="NAME,...",
        help="mechanisms to look for, joined by commas (default: all; their names: docs/mechanisms)",
    )
    add("--alpha", type=float, default=0.05, metavar="P", help="probability of a false alarm (default: 0.05)")
    add("--seed", default=0, help="of all draws (default: 0)")
    add("--no-discretisation")
    add(
        "--ablation",
        choices=("no-nuisances",),
        help="leave out what makes the method work, for comparisons: credit mechanisms with what stiffness, "
        "registration and mesh could explain",
    )
    add("--homogeneous", action="store_true", help="of a specimen: take its state for homogeneous whatever its grips")
    add("--device", *WARPED)
    add_results(parser, "warpbrain-diagnose-CASE")
    parser.set_defaults(call=_run)


def _run(options: argparse.Namespace) -> None:
    from warpbrain.estimation.options import Listener
    from warpbrain.worlds.options import DiagnosisOptions

    kinds = None if options.candidates == "all" else tuple(options.candidates.split(","))
    chosen = DiagnosisOptions(
        kinds,
        options.alpha,
        options.seed,
        mesh_error=not options.no_discretisation,
        without_nuisances=options.ablation == "no-nuisances",
        ends=not options.homogeneous,
    )
    record: Record = options.record
    say = record.say

    from warpbrain.atomic import safe_name
    from warpbrain.cases.shipped import find_case
    from warpbrain.report.diagnosis.description import describe
    from warpbrain.report.diagnosis.files import write_explained
    from warpbrain.report.diagnosis.page import write_page
    from warpbrain.report.diagnosis.text import diagnosis_lines
    from warpbrain.report.files import write_summary
    from warpbrain.report.state_files import read_state
    from warpbrain.simulation.system import find_device
    from warpbrain.terminal.quiet import start_warp_quietly
    from warpbrain.terminal.result_folder import choose_folder, results_in

    start_warp_quietly()
    device = find_device(options.device).alias
    images = warp.requested(options)
    case = find_case(options.case, options.tissue)
    warp.check_place(images, case)
    run, tables = _of_a_body() if case.specimen is None else _of_a_specimen()

    diagnosing = run(case, chosen, device, Listener(lambda text: say(f"  {text}")))
    out = choose_folder(options.out, f"warpbrain-diagnose-{safe_name(case.name)}", options.overwrite)
    note_case(record, case, device)
    say(case.title)
    diagnosis = diagnosing.run()
    summary = describe(diagnosis, chosen, device)
    say(*diagnosis_lines(summary), sep="\n")
    with results_in(out, record, options.overwrite):
        for name, write in tables.items():
            write(out / name, diagnosis)
        record.files += ["report.html", "diagnosis.json", *tables]
        if diagnosis.explained is not None:
            write_explained(out / "explained", diagnosis.explained)
            record.files.append("explained")
        # after all that it speaks of: whoever finds it finds the others
        write_summary(out / "diagnosis.json", summary)
        state = None if case.specimen is not None else read_state(out / "state.vtu")
        write_page(out / "report.html", diagnosis, summary, state)
        if images is not None and state is not None:
            warp.warp(state, out, images, record, options.quiet)


#: What diagnoses a case, and what is written of it beside what all cases have.
_Way = tuple[Callable[..., Any], dict[str, Callable[[Path, Any], None]]]


def _of_a_body() -> _Way:
    from warpbrain.diagnosis.diagnose import Diagnosing
    from warpbrain.report.diagnosis.files import write_covariance, write_diagnosed_state, write_map, write_points

    return Diagnosing, {
        "map.vtu": write_map,
        "state.vtu": write_diagnosed_state,
        "points.csv": write_points,
        "covariance.npz": write_covariance,
    }


def _of_a_specimen() -> _Way:
    from warpbrain.report.diagnosis.files import write_curves
    from warpbrain.worlds.specimen.diagnose import DiagnosingSpecimen

    return DiagnosingSpecimen, {"curves.csv": write_curves}
