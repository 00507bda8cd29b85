"""`warpbrain diagnose` of a case with a specimen: what its tests say of the physics that the case leaves out."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from warpbrain.cases.case import Case
from warpbrain.diagnosis.options import DiagnosisOptions, Listener
from warpbrain.terminal.progress import Progress


def run(
    options: argparse.Namespace, case: Case, asked: DiagnosisOptions, device: str, say: Callable[..., None]
) -> None:
    """Diagnose and write.

    Parameters
    ----------
    options : argparse.Namespace
        Of `warpbrain diagnose`.
    case : Case
        With a specimen.
    asked : DiagnosisOptions
    device : str
    say : callable
        `print`, or what stands for it.

    Raises
    ------
    InputError
        If nothing can be concluded from the tests.
    """
    from warpbrain.atomic import output_folder, safe_name
    from warpbrain.diagnosis.specimen.diagnose import DiagnosingSpecimen
    from warpbrain.report.diagnosis.files import write_explained
    from warpbrain.report.diagnosis.html import write_page
    from warpbrain.report.diagnosis.specimen import describe_specimen_diagnosis, specimen_diagnosis_lines
    from warpbrain.report.diagnosis.specimen_curves import write_curves
    from warpbrain.report.files import write_summary

    progress = Progress("diagnosis", options.quiet)

    def on_stage(text: str) -> None:
        progress.clear()
        say(f"  {text}")

    diagnosing = DiagnosingSpecimen(case, asked, device, Listener(on_stage, progress.show))
    out = output_folder(options.out or Path(f"warpbrain-diagnose-{safe_name(case.name)}"))
    say(case.title)
    try:
        found = diagnosing.run()
    finally:
        progress.clear()
    said = describe_specimen_diagnosis(found, asked, device)
    say("", *specimen_diagnosis_lines(said), sep="\n")
    write_curves(out / "curves.csv", found)
    written = ["curves.csv"]
    if found.explained is not None:
        write_explained(out / "explained", found.explained)
        written.append("explained")
    # after all that it speaks of: whoever finds it finds the others
    write_summary(out / "diagnosis.json", said)
    write_page(out)
    say("", f"written to {out}: report.html, diagnosis.json, {', '.join(written)}", sep="\n")
