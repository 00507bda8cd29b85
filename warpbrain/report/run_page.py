"""`report.html` of a run: what moved, how far that is from what was recorded, and what the model leaves out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpbrain.mesh import TetMesh
from warpbrain.physics.words import tabled
from warpbrain.report import views
from warpbrain.report.body_sections import before_and_after, in_three_dimensions
from warpbrain.report.comparison import explained_of
from warpbrain.report.explained import IN_PART, NEARER, NO_NEARER, UNKNOWN, WORSE, number
from warpbrain.report.generative.page import BLACK, GREEN, ORANGE, QUIET, VERMILLION
from warpbrain.report.mesh_error import mesh_error_lines
from warpbrain.report.page.document import document, header, listed, section, text, write_document
from warpbrain.report.page.scene import Field
from warpbrain.report.page.tables import table
from warpbrain.report.picture import Moved, Pictures
from warpbrain.report.summary import SET_TITLES
from warpbrain.simulation.result import Result

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
    """Write the page.

    Parameters
    ----------
    path : Path
    summary : mapping
        What `summary.json` holds.
    result : Result
    whole : TetMesh
        The anatomy before anything was resected.
    moved : Moved
    pictures : Pictures or str
        Or why there are none.
    """
    case, said = summary["case"], summary["result"]
    judged = explained_of(summary["recordings"]["compared"])
    fields = [
        Field(
            name.replace("_", " "), f"{name.replace('_', ' ')} [Pa]", values, float(values.min()), float(values.max())
        )
        for name, values in result.nodal_pressures.items()
    ]
    places = views.places(whole, views.resected_elements(whole))
    drawn = None if isinstance(pictures, str) else pictures
    sections = [
        before_and_after(drawn, pictures if isinstance(pictures, str) else ""),
        section("What was recorded", recordings_table(summary["recordings"]["compared"]), _not_compared(summary)),
        section("What the model leaves out", listed(case["left_out"])),
        in_three_dimensions(result.mesh, result.u, fields, moved, places),
        section("Displacement", _displacements(said)),
        section("Error of the mesh", _mesh_error(summary)),
        section("What was assumed", listed(case["assumptions"]), tissue_table(case), remarks(case["remarks"])),
        section("How it was computed", _solution(summary), versions(summary["versions"])),
    ]
    largest = said["displacement_mm"]["all nodes"]["largest"]
    facts = [("largest displacement", f"{largest:.3g} mm")]
    if judged.before is not None:
        facts.append(("RMSE, no motion → this", f"{judged.before:.3g} → {judged.after:.3g} mm"))
    sentences = judged.sentences or ["Nothing was recorded of this case that the simulation could be compared with."]
    top = header(case["title"], judged.verdict, sentences, facts)
    write_document(path, document(f"{case['name']}: {case['title']}", top, sections, BADGES[judged.verdict]))


def recordings_table(compared: Sequence[Mapping[str, Any]]) -> str:
    """Errors at recordings, before and after."""
    rows = []
    for one in compared:
        noise = one["noise_root_mean_square"]
        rows.append(
            [
                text(one["name"]),
                f"{one['count']}",
                number(one["before"]["root_mean_square"], one["unit"]),
                number(one["after"]["root_mean_square"], one["unit"]),
                number(one["after"]["percentile_95"], one["unit"]),
                number(one["after"]["largest"], one["unit"]),
                "" if noise is None else number(noise, one["unit"]),
                text(one["unit"]),
                "check" if one["role"] == "check" else "",
            ]
        )
    head = ("recording", "rows", "nothing moves", "this", "95 %", "largest", "noise alone", "unit", "role")
    caption = "Root mean square; 95 % and largest of this state"
    return table(head, rows, numbers=range(1, 7), caption=caption) if rows else "<p>Nothing was recorded.</p>"


def _not_compared(summary: Mapping[str, Any]) -> str:
    reasons = summary["recordings"]["not_compared"]
    return f"<h3>Not compared</h3>{listed(reasons)}" if reasons else ""


def _displacements(said: Mapping[str, Any]) -> str:
    rows = [
        [text(SET_TITLES.get(name, name)), f"{s['nodes']}"]
        + [tabled(s[key]) for key in ("mean", "root_mean_square", "percentile_95", "largest")]
        for name, s in said["displacement_mm"].items()
    ]
    head = ("nodes of", "nodes", "mean [mm]", "RMS [mm]", "95 % [mm]", "largest [mm]")
    J, stress = said["volume_ratio_J"], said["von_mises_Pa"]["largest"]
    low, high = said["principal_stretch"]["smallest"], said["principal_stretch"]["largest"]
    return table(head, rows, numbers=range(1, 6)) + (
        f"<p>Volume ratio J {J['smallest']:.3f} to {J['largest']:.3f}; principal stretches {low:.3f} to {high:.3f}; "
        f"largest von Mises stress {stress:.3g} Pa.</p>"
    )


def _mesh_error(summary: Mapping[str, Any]) -> str:
    if "mesh_error" not in summary:
        return ""
    return f'<pre class="wide" tabindex="0">{text(chr(10).join(mesh_error_lines(summary["mesh_error"])))}</pre>'


def tissue_table(case: Mapping[str, Any]) -> str:
    """Laws of the tissues, and the mesh."""
    rows = [
        [label, text(one["name"]), text(f"{one['law']} ({one['formulation']})"), f"{one['shear_modulus_Pa']:.4g}"]
        for label, one in case["tissues"].items()
    ]
    mesh = (
        f"<p>{case['nodes']} nodes and {case['tetrahedra']} tetrahedra of elements {text(case['elements'])} "
        f"({text(case['elements_chosen'])}); {case['volume_cm3']:.1f} cm³, {case['mass_kg']:.4g} kg, Poisson ratio "
        f"{case['poisson']:g}.</p>"
    )
    return table(("label", "tissue", "law", "shear modulus [Pa]"), rows, numbers=(3,)) + mesh


def remarks(sentences: Sequence[str]) -> str:
    """Remarks under a heading of their own; nothing of none."""
    return f"<h3>Remarks</h3>{listed(sentences)}" if sentences else ""


def _solution(summary: Mapping[str, Any]) -> str:
    solution, device = summary["solution"], summary["device"]
    said = [f"{text(solution['kind'])}, {len(solution['history'])} recorded steps"]
    if "time_s" in solution:
        said.append(f"until {solution['time_s']:.4g} s")
    if "relative_residual" in solution:
        said.append(
            f"relative out-of-balance force {solution['relative_residual']:.1e} (goal {solution['tolerance']:.0e})"
        )
    seconds = [[text(name), f"{value:.2f}"] for name, value in summary["seconds_by_phase"].items()]
    return (
        f"<p>{'; '.join(said)}. On {text(device['name'])} ({text(device['alias'])}) in {text(device['precision'])} "
        f"precision.</p>{table(('phase', 'time [s]'), seconds, numbers=(1,))}"
    )


def versions(known: Mapping[str, str]) -> str:
    """Versions of what computed it, and the files that hold the numbers."""
    return f"<p>Versions: {text(', '.join(f'{key} {value}' for key, value in known.items()))}.</p>"
