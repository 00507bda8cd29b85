"""`warpbrain diagnose`: what was left out of a case."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from warpbrain.terminal.progress import Progress


def add_parser(commands: argparse._SubParsersAction[Any]) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "diagnose",
        help="say what physics a case leaves out",
        description="Locates where simulation and recordings differ, names the physics that was left out, models it, "
        "and shows the fit improve on data it was not fitted to. Writes "
        "report.html, diagnosis.json, map.vtu, points.csv and explained/.",
    )
    add = parser.add_argument
    add("--case", required=True, metavar="NAME", help="0529, ... (see warpbrain cases), or the path of a case folder")
    add("--tissue", choices=("single", "multi"), default="multi", help="one tissue, or grey and white (default)")
    add(
        "--candidates",
        default="all",
        metavar="NAME,...",
        help="mechanisms to look for, joined by commas (default: all; their names: docs/mechanisms)",
    )
    add("--alpha", type=float, default=0.05, metavar="P", help="probability of a false alarm (default: 0.05)")
    add("--seed", type=int, default=0, metavar="S", help="of all draws (default: 0)")
    add("--no-discretisation", action="store_true", help="take the mesh for exact")
    add(
        "--ablation",
        choices=("no-nuisances",),
        help="leave out what makes the method work, for comparisons: credit mechanisms with what stiffness, "
        "registration and mesh could explain",
    )
    add("--homogeneous", action="store_true", help="of a specimen: take its state for homogeneous whatever its grips")
    add("--device", metavar="NAME", help="cpu, cuda:0, ... (default: the GPU if there is one, else cpu)")
    add("--out", type=Path, metavar="DIR", help="folder for the results (default: warpbrain-diagnose-CASE)")
    add("--quiet", action="store_true", help="print nothing but errors")
    parser.set_defaults(call=_run)


def _run(options: argparse.Namespace) -> None:
    from warpbrain.diagnosis.options import DiagnosisOptions, Listener

    kinds = None if options.candidates == "all" else tuple(options.candidates.split(","))
    asked = DiagnosisOptions(
        kinds,
        options.alpha,
        options.seed,
        mesh_error=not options.no_discretisation,
        without_nuisances=options.ablation == "no-nuisances",
        ends=not options.homogeneous,
    )
    say: Callable[..., None] = _silent if options.quiet else print

    from warpbrain.atomic import output_folder, safe_name
    from warpbrain.cases.shipped import find_case
    from warpbrain.diagnosis.diagnose import Diagnosing
    from warpbrain.report.diagnosis.description import describe_diagnosis
    from warpbrain.report.diagnosis.files import write_explained, write_map
    from warpbrain.report.diagnosis.html import write_page
    from warpbrain.report.diagnosis.points import write_points
    from warpbrain.report.diagnosis.text import diagnosis_lines
    from warpbrain.report.files import write_summary
    from warpbrain.simulation.system import find_device
    from warpbrain.terminal.quiet import start_warp_quietly

    start_warp_quietly()
    device = find_device(options.device)
    case = find_case(options.case, options.tissue)
    if case.specimen is not None:
        from warpbrain.cli import diagnose_specimen

        diagnose_specimen.run(options, case, asked, device.alias, say)
        return
    out = output_folder(options.out or Path(f"warpbrain-diagnose-{safe_name(case.name)}"))
    say(case.title)
    progress = Progress("diagnosis", options.quiet)

    def on_stage(text: str) -> None:
        progress.clear()
        say(f"  {text}")

    try:
        found = Diagnosing(case, asked, device.alias, Listener(on_stage, progress.show)).run()
    finally:
        progress.clear()
    said = describe_diagnosis(found, asked, device.alias)
    say("", *diagnosis_lines(said), sep="\n")
    write_map(out / "map.vtu", found)
    write_points(out / "points.csv", found)
    written = ["map.vtu", "points.csv"]
    if found.explained is not None:
        write_explained(out / "explained", found.explained)
        written.append("explained")
    # after all that it speaks of: whoever finds it finds the others
    write_summary(out / "diagnosis.json", said)
    write_page(out)
    say("", f"written to {out}: report.html, diagnosis.json, {', '.join(written)}", sep="\n")


def _silent(*_values: object, **_options: object) -> None:
    """Stands for `print` where nothing is to be said."""
