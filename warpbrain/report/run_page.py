"""`report.html` of a run: what moved, how far that is from what was recorded, and what the model leaves out.

Of tests of a specimen it is their curves in the place of a body. The words are in `page/run.html`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpbrain.mesh import TetMesh
from warpbrain.physics.words import tabled
from warpbrain.report import views
from warpbrain.report.body_sections import before_and_after, body_view
from warpbrain.report.comparison import (
    IN_PART,
    NEARER,
    NO_NEARER,
    UNKNOWN,
    WORSE,
    error_text,
    explained_of,
    mesh_error_lines,
)
from warpbrain.report.page import Top, document, sections_of, write_document
from warpbrain.report.page.figures import inlined
from warpbrain.report.page.scene import Field
from warpbrain.report.picture import Moved, Pictures
from warpbrain.report.specimen import tests_figure
from warpbrain.report.summary import SET_TITLES
from warpbrain.report.views import BLACK, BLUE, GREEN, ORANGE, QUIET, VERMILLION
from warpbrain.simulation.result import Result
from warpbrain.simulation.specimen import Tested

#: Ground and letters of what stands on top.
BADGES = {
    NEARER: (GREEN, "#ffffff"),
    IN_PART: (ORANGE, BLACK),
    NO_NEARER: (ORANGE, BLACK),
    WORSE: (VERMILLION, "#ffffff"),
    UNKNOWN: (QUIET, "#ffffff"),
}


def write_run_page(
    path: Path, summary: Mapping[str, Any], result: Result, whole: TetMesh, moved: Moved, pictures: Pictures | str
) -> None:
    """Write the page of a run.

    `summary` is what `summary.json` holds, `whole` the anatomy before anything was resected; without pictures it is
    said why there are none.
    """
    case, described, solution = summary["case"], summary["result"], summary["solution"]
    judged = explained_of(summary["recordings"]["compared"])
    fields = [
        Field(
            name.replace("_", " "), f"{name.replace('_', ' ')} [Pa]", values, float(values.min()), float(values.max())
        )
        for name, values in result.nodal_pressures.items()
    ]
    places = views.places(whole)
    solved = [f"{solution['kind']}, {len(solution['history'])} recorded steps"]
    if "time_s" in solution:
        solved.append(f"until {solution['time_s']:.4g} s")
    if "relative_residual" in solution:
        residual = f"{solution['relative_residual']:.1e} (goal {solution['tolerance']:.0e})"
        solved.append(f"relative out-of-balance force {residual}")
    largest = described["displacement_mm"]["all nodes"]["largest"]
    facts = [("largest displacement", f"{largest:.3g} mm")]
    if judged.before is not None:
        facts.append(("RMSE, no motion → this", f"{judged.before:.3g} → {judged.after:.3g} mm"))
    sentences = judged.sentences or ["Nothing was recorded of this case that the simulation could be compared with."]
    _write(
        path, summary, Top(case["title"], judged.verdict, BADGES[judged.verdict], sentences, facts),
        pictures=before_and_after(pictures),
        view=body_view(result.mesh, result.u, fields, moved, places),
        displacements=[
            [SET_TITLES.get(name, name), s["nodes"]]
            + [tabled(s[key]) for key in ("mean", "root_mean_square", "percentile_95", "largest")]
            for name, s in described["displacement_mm"].items()
        ],
        mesh_error=mesh_error_lines(summary["mesh_error"]) if "mesh_error" in summary else [],
        solution=solved,
    )  # fmt: skip


def write_specimen_page(path: Path, summary: Mapping[str, Any], tests: Sequence[Tested]) -> None:
    """Write the page of tests; `summary` is what `summary.json` holds."""
    figure = inlined(
        lambda narrow: tests_figure(tests, 1 if narrow else 2),
        f"Recorded and simulated curves of {len(tests)} tests.",
        "Each test as it was recorded and as it is simulated. What is marked check is not to be fitted.",
    )
    worse = explained_of(summary["recordings"]["compared"]).sentences
    sentences = worse or ["Every test is nearer to this simulation than to none."]
    top = Top(
        summary["case"]["title"], "tests of a specimen", (BLUE, "#ffffff"), sentences, [("tests", f"{len(tests)}")]
    )
    _write(path, summary, top, tests=figure)


def _write(path: Path, summary: Mapping[str, Any], top: Top, **values: Any) -> None:
    case = summary["case"]
    nothing = {"tests": "", "pictures": "", "view": "", "displacements": [], "mesh_error": [], "solution": []}
    sections = sections_of(
        "run.html", summary=summary, **{**nothing, **values},
        recorded=[_recorded(one) for one in summary["recordings"]["compared"]],
        tissues=[
            [label, one["name"], f"{one['law']} ({one['formulation']})", f"{one['shear_modulus_Pa']:.4g}"]
            for label, one in case["tissues"].items()
        ],
        seconds=[[name, f"{value:.2f}"] for name, value in summary["seconds_by_phase"].items()],
    )  # fmt: skip
    write_document(path, document(f"{case['name']}: {case['title']}", top, sections))


def _recorded(one: Mapping[str, Any]) -> list[Any]:
    noise, after = one["noise_root_mean_square"], one["after"]
    errors = (
        one["before"]["root_mean_square"],
        *(after[key] for key in ("root_mean_square", "percentile_95", "largest")),
    )
    return [
        *(one["name"], one["count"], *(error_text(value, one["unit"]) for value in errors)),
        *("" if noise is None else error_text(noise, one["unit"]), one["unit"]),
        "check" if one["role"] == "check" else "",
    ]
