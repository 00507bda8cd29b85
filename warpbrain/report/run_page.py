"""`report.html` of a run: what moved, how far that is from what was recorded, and what the model leaves out.

Of tests of a specimen it is their curves in the place of a body. The words are in `page/run.html`.
"""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpbrain.atomic import write_text
from warpbrain.report import views
from warpbrain.report.body_sections import before_and_after, body_view
from warpbrain.report.comparison import IN_PART, NEARER, NO_NEARER, UNKNOWN, WORSE, explained_of, recorded_rows
from warpbrain.report.page import lines, page
from warpbrain.report.page.figures import inlined
from warpbrain.report.page.scene import Field
from warpbrain.report.picture import Moved, Pictures, begin_pictures, draw
from warpbrain.report.specimen import tests_figure
from warpbrain.report.summary import displacement_rows
from warpbrain.report.views import BLACK, BLUE, GREEN, ORANGE, QUIET, VERMILLION
from warpbrain.simulation.run import Run
from warpbrain.simulation.specimen import Tested

#: Letters of a line of a picture's title.
_LINE = 150
#: Ground and letters of what stands on top.
BADGES = {
    NEARER: (GREEN, "#ffffff"),
    IN_PART: (ORANGE, BLACK),
    NO_NEARER: (ORANGE, BLACK),
    WORSE: (VERMILLION, "#ffffff"),
    UNKNOWN: (QUIET, "#ffffff"),
}


def write_run_page(folder: Path, summary: Mapping[str, Any], run: Run) -> Pictures | str:
    """Write `deformation.png` and `report.html` of a run; `summary` is what `summary.json` holds.

    Returns the pictures, or why there are none.
    """
    case, solution = summary["case"], summary["solution"]
    judged, result = explained_of(summary["recordings"]["compared"]), run.result
    compared = ((c.name, c.rows, c.residuals_before, c.residuals_after) for c in run.observed.comparisons)
    moved = Moved.of(run.case.recordings, compared)
    left_out = [line for text in case["left_out"][:1] for line in textwrap.wrap(f"Left out, {text}", _LINE)]
    subtitles = [*lines("run.txt", "subtitle", case, solution), *summary["recordings"]["in_words"], *left_out]
    begun = begin_pictures(run.case, result.u, moved)
    pressures = {name.replace("_", " "): values for name, values in result.nodal_pressures.items()}
    fields = [Field(name, f"{name} [Pa]", p, float(p.min()), float(p.max())) for name, p in pressures.items()]
    view = body_view(result.mesh, result.u, fields, moved, views.places(run.case.mesh))
    pictures = draw(folder / "deformation.png", begun, run.case.title, subtitles)
    sentences = judged.sentences or ["Nothing was recorded of this case that the simulation could be compared with."]
    _write(
        folder / "report.html", summary, judged.verdict, BADGES[judged.verdict], sentences,
        pictures=before_and_after(pictures),
        view=view,
        judged=judged,
        displacements=displacement_rows(summary["result"]),
    )  # fmt: skip
    return pictures


def write_specimen_page(path: Path, summary: Mapping[str, Any], tests: Sequence[Tested]) -> None:
    """Write the page of tests; `summary` is what `summary.json` holds."""
    figure = inlined(lambda narrow: tests_figure(tests, 1 if narrow else 2))
    worse = explained_of(summary["recordings"]["compared"]).sentences
    sentences = worse or ["Every test is nearer to this simulation than to none."]
    _write(path, summary, "tests of a specimen", (BLUE, "#ffffff"), sentences, tests=figure)


def _write(
    path: Path,
    summary: Mapping[str, Any],
    badge: str,
    colours: tuple[str, str],
    sentences: Sequence[str],
    **values: Any,
) -> None:
    case = summary["case"]
    window = f"{case['name']}: {case['title']}"
    text = page(
        window, case["title"], badge, colours, sentences, "run.html", summary=summary, **values,
        recorded=recorded_rows(summary["recordings"]["compared"]),
        tissues=[
            [label, tissue["name"], f"{tissue['law']} ({tissue['formulation']})", f"{tissue['shear_modulus_Pa']:g}"]
            for label, tissue in case["tissues"].items()
        ],
        seconds=[[name, f"{value:.2f}"] for name, value in summary["seconds_by_phase"].items()],
    )  # fmt: skip
    write_text(path, text)
