"""`report.html` of an estimate: the tissue, how well it is known, and what it makes of what was recorded.

The words are in `page/estimate.html`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from warpbrain.atomic import write_text
from warpbrain.estimation.posterior import Posterior
from warpbrain.inference.calibration import percent
from warpbrain.report import views
from warpbrain.report.body_sections import before_and_after, body_view, fields_of, known_displacement
from warpbrain.report.comparison import Explained, explained
from warpbrain.report.estimate import (
    averaged_row,
    parameter_row,
    prediction_row,
    recorded_points,
)
from warpbrain.report.estimate_picture import agreement_figure, densities_figure
from warpbrain.report.page import Top, document, lines, sections_of
from warpbrain.report.page.figures import inlined
from warpbrain.report.picture import Moved, Pictures, begin_pictures, draw
from warpbrain.report.run_page import BADGES
from warpbrain.report.state_files import read_state
from warpbrain.report.summary import left_out
from warpbrain.simulation.of_case import model_of

#: Causes that are less probable are not listed.
_LIKELY = 0.01
#: What the standard deviation of the displacement is of.
_KNOWN = (
    "It is what is not known of the tissue, to first order about this state: what else may act is not in it, nor the "
    "error of the mesh."
)


def moved_of(posterior: Posterior) -> Moved:
    """Points that were recorded, and where the estimate, with its nuisances, has them."""
    points = [
        np.column_stack([recording.points[prediction.rows], prediction.before, prediction.before - prediction.after])
        for prediction, recording in recorded_points(posterior, surfaces=False)
    ]
    return Moved(*np.split(np.concatenate([np.zeros((0, 9)), *points]), 3, axis=1))


def judged_of(summary: Mapping[str, Any]) -> Explained:
    """Whether an estimate explains its recordings better than no motion at all."""
    entries = [
        {**prediction, "before": prediction["root_mean_square_before"], "after": prediction["root_mean_square_after"]}
        for prediction in summary["predictions"]
    ]
    return explained(entries, "this estimate")


def write_estimate_page(folder: Path, summary: Mapping[str, Any], posterior: Posterior) -> Pictures | str:
    """Write `deformation.png` and `report.html` beside `state.vtu`; `summary` is what `estimate.json` holds.

    Returns the pictures, or why there are none.
    """
    case, judged, nothing = summary["case"], judged_of(summary), summary["nothing_else"]
    whole, state, moved = posterior.case.mesh, read_state(folder / "state.vtu"), moved_of(posterior)
    titles = {label: tissue.name for label, tissue in posterior.case.tissues.items()}
    subtitles = ["the most probable state of the estimate", *judged.sentences]
    begun = begin_pictures(whole, state.mesh, state.u, titles, moved)
    places = views.places(whole)
    tissue = [parameter_row(parameter) for parameter in summary["parameters"]]
    names = ", ".join(f"{row[0]}, {row[1]}" for row in tissue)
    agreement = Markup()
    if any(prediction.kind != "surface" for prediction in posterior.predictions):
        words = "Every component that was recorded beside what the estimate makes of it; on the line they agree."
        agreement = inlined(
            lambda narrow: agreement_figure(posterior, narrow), "Observed beside predicted components.", words
        )
    causes = [] if nothing is None else [cause for cause in nothing["causes"] if cause["probability"] >= _LIKELY]
    pictures = draw(folder / "deformation.png", begun, case["title"], subtitles)
    sections = sections_of(
        "estimate.html", summary=summary, agreement=agreement,
        tissue=tissue,
        tied=lines("estimate.txt", "tied", summary), checks=lines("estimate.txt", "checks", summary),
        densities=inlined(
            lambda narrow: densities_figure(posterior, narrow), f"Prior and posterior of {names}.",
            "Each parameter before (dashed, filled) and after (line); dotted: the ends of its 95 % interval.",
        ),
        causes=[[cause["name"], percent(cause["probability"])] for cause in causes],
        averaged=[] if nothing is None else [
            [f"{tissue}, {name}", middle, interval, unit]
            for tissue, name, middle, _, interval, unit in map(averaged_row, nothing["tissue"])
        ],
        recorded=[prediction_row(prediction) for prediction in summary["predictions"]],
        pictures=before_and_after(pictures),
        known=known_displacement(state, whole, places, _KNOWN),
        view=body_view(state.mesh, state.u, fields_of(state), moved, places),
        left_out=left_out(model_of(posterior.case)),
        seconds=[[name, f"{value:.1f}"] for name, value in summary["seconds"].items()],
        files=[[name, Markup("<code>{}</code>").format(value)] for name, value in summary["inputs_sha256"].items()],
    )  # fmt: skip
    facts = [
        (f"{name}, {parameter}", f"{estimate} Pa ({interval})")
        for name, parameter, estimate, _, interval, *_, unit in tissue
        if unit == "Pa"
    ]
    if judged.before is not None:
        facts.append(("RMSE, no motion → this", f"{judged.before:.3g} → {judged.after:.3g} mm"))
    if nothing is not None:
        facts.append(("probability that nothing else acts", percent(nothing["probability"])))
    sentences = [*summary["identifiability"]["sentences"], *judged.sentences]
    top = Top(case["title"], judged.verdict, BADGES[judged.verdict], sentences, facts)
    write_text(folder / "report.html", document(f"{case['name']}: tissue of {case['title']}", top, sections))
    return pictures
