"""`warpbrain diagnose`: what was left out of a case."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from warpbrain.atomic import safe_name, write_text
from warpbrain.cases.shipped import find_case
from warpbrain.cli import warp
from warpbrain.cli.log import note_case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.errors import InputError
from warpbrain.estimation.options import Listener
from warpbrain.kernels.module import find_device
from warpbrain.report.diagnosis import files
from warpbrain.report.diagnosis.description import describe
from warpbrain.report.diagnosis.page import page_of, pictures_of
from warpbrain.report.diagnosis.text import diagnosis_lines
from warpbrain.report.files import read_state, write_summary
from warpbrain.terminal.memory import keep_freed_memory
from warpbrain.terminal.quiet import start_warp_quietly
from warpbrain.terminal.record import Record
from warpbrain.terminal.result_folder import choose_folder, results_in
from warpbrain.threads import beside
from warpbrain.worlds.options import DiagnosisOptions
from warpbrain.worlds.specimen.diagnose import DiagnosingSpecimen

#: What is written of a body, and of a specimen, beside what all cases have.
_OF_A_BODY: dict[str, Callable[[Path, Any], None]] = {
    "map.vtu": files.write_map,
    "state.vtu": files.write_diagnosed_state,
    "points.csv": files.write_points,
    "covariance.npz": files.write_covariance,
}
_OF_A_SPECIMEN: dict[str, Callable[[Path, Any], None]] = {"curves.csv": files.write_curves}


def diagnose(options: argparse.Namespace) -> None:
    """Say what was left out of a case."""
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

    keep_freed_memory()
    start_warp_quietly()
    device = find_device(options.device).alias
    images = warp.requested(options)
    case = find_case(options.case, options.tissue)
    if options.homogeneous and case.specimen is None:
        raise InputError(f"--homogeneous: {case.path} has no [specimen]")
    warp.check_place(images, case)
    run: Callable[..., Any] = Diagnosing if case.specimen is None else DiagnosingSpecimen
    tables = _OF_A_BODY if case.specimen is None else _OF_A_SPECIMEN
    diagnosing = run(case, chosen, device, Listener(lambda text: say(f"  {text}")))
    out = choose_folder(options.out, f"warpbrain-diagnose-{safe_name(case.name)}", options.overwrite)
    note_case(record, case, device)
    say(case.title)
    diagnosis = diagnosing.run()
    summary = describe(diagnosis, chosen, device)
    say(*diagnosis_lines(summary))
    with results_in(out, record, options.overwrite):
        # most of what is left to do, beside files for which factors are computed
        drawing = beside(lambda: pictures_of(diagnosis, summary))
        for name, write in tables.items():
            write(out / name, diagnosis)
        record.files += ["report.html", "diagnosis.json", *tables]
        if diagnosis.explained is not None:
            files.write_explained(out / "explained", diagnosis.explained)
            record.files.append("explained")
        # after all that it speaks of: whoever finds it finds the others
        write_summary(out / "diagnosis.json", summary)
        state = None if case.specimen is not None else read_state(out / "state.vtu")
        write_text(out / "report.html", page_of(diagnosis, summary, state, drawing()))
        if images is not None and state is not None:
            warp.warp(state, out, images, record, options.quiet)
