"""`report.html`: one file that says what a diagnosis found; it needs no network. Its words are in `page.html`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from warpbrain.diagnosis.result import Diagnosis
from warpbrain.inference.decide import CANNOT_SAY, GROUP, NAMED, NAMED_AND_REST, NOT_PHYSICS, NOTHING, UNKNOWN
from warpbrain.inference.probability import percent
from warpbrain.report.diagnosis.anatomy import Anatomy, map_figure, residuals_figure, view_of
from warpbrain.report.diagnosis.description import STATES
from warpbrain.report.diagnosis.figures import agreement_figure, confusion_figure, curves_figure
from warpbrain.report.diagnosis.files import Recorded
from warpbrain.report.diagnosis.text import sets_of, unit_of, when_in_words, where_in_words
from warpbrain.report.generative.page import BLACK, BLUE, GREEN, ORANGE, PURPLE, QUIET, SKY
from warpbrain.report.page.document import Section, document, header, write_document
from warpbrain.report.page.tables import table
from warpbrain.report.page.viewer import viewer
from warpbrain.worlds.specimen.result import SpecimenDiagnosis

#: Ground and text of each verdict's badge; the word says it too.
_BADGES = {
    NOTHING: (GREEN, "#ffffff"),
    NAMED: (BLUE, "#ffffff"),
    NAMED_AND_REST: (BLUE, "#ffffff"),
    GROUP: (SKY, BLACK),
    UNKNOWN: (PURPLE, BLACK),
    NOT_PHYSICS: (ORANGE, BLACK),
    CANNOT_SAY: (QUIET, "#ffffff"),
}
Rows = list[list[Any]]


def write_page(path: Path, found: Diagnosis | SpecimenDiagnosis, said: dict[str, Any]) -> None:
    """Write the page of a diagnosis; arguments as of `page_of`."""
    write_document(path, page_of(found, said))


def page_of(found: Diagnosis | SpecimenDiagnosis, said: dict[str, Any]) -> str:
    """The page.

    Parameters
    ----------
    found : Diagnosis or SpecimenDiagnosis
    said : dict
        Its `diagnosis.json`.
    """
    sections: list[Section] = []

    def section(title: str, caller: Callable[[], Markup]) -> str:
        sections.append(Section(title, str(caller()).strip()))
        return ""

    environment = Environment(
        loader=PackageLoader("warpbrain.report.diagnosis", "."), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {"percent": percent, "table": _table}
    recorded = Recorded.of(found) if isinstance(found, Diagnosis) else None
    environment.get_template("page.html").render(
        section=section,
        said=said,
        pictures=defaultdict(str, {name: Markup(one) for name, one in _pictures(found, said, recorded).items()}),
        sets=[[causes, p, f"{evidence:+.1f}"] for causes, p, evidence in sets_of(said)],
        rejected=[[o["mechanism"], o["rejected_because"]] for o in said["ranking"] if o["log_evidence"] is None],
        next=[[one["what"], f"{one['expected_nats']:.1f}"] for one in said["next_measurement"]],
        candidates=_candidates(said),
        fit=_fit(said),
        placebos=_placebos(said),
        smallest=_smallest(said),
        hashes=[[name, Markup("<code>{}</code>").format(sha)] for name, sha in said["inputs_sha256"].items()],
        aside=[] if recorded is None else _aside(recorded),
        where=said["where"] and where_in_words(said["where"]),
        when=said["when"] and when_in_words(said["when"]),
        chances={one["mechanism"]: one["probability"] for one in said["ranking"]},
        error="mm of distance in space" if unit_of(said)[0] == "m" else "Pa of stress",
    )
    top = header(said["case"]["title"], said["verdict"], [said["sentence"]], _facts(said))
    return document(f"{said['verdict']}: {said['case']['title']}", top, sections, _BADGES[said["verdict"]])


def _table(rows: Iterable[Sequence[Any]], head: Sequence[str], numbers: Sequence[int] = (), caption: str = "") -> str:
    """A table of cells whose words are no markup; nothing of none."""
    cells = [[str(escape(cell)) for cell in row] for row in rows]
    return Markup(table(head, cells, numbers, caption)) if cells else ""


def _pictures(found: Diagnosis | SpecimenDiagnosis, said: dict[str, Any], recorded: Recorded | None) -> dict[str, str]:
    """Figures and the 3-D view by name; of what was not recorded there are none."""
    if recorded is None or not isinstance(found, Diagnosis):
        return {"curves": curves_figure(found)} if isinstance(found, SpecimenDiagnosis) else {}
    anatomy = Anatomy(found, said)
    pictures, points = {"map": map_figure(anatomy)}, recorded.lengths.any() and not recorded.vectors.aside.all()
    if points:
        pictures["residuals"] = residuals_figure(anatomy, recorded)
    if recorded.counted.any():
        pictures["agreement"] = agreement_figure(said, recorded)
    view = view_of(anatomy, recorded if points else None)
    pictures["view"] = viewer(view, "what is left", "Arrows go from the computed to the observed place.")
    if said["confusion"]["rows"]:
        pictures["confusion"] = confusion_figure(said["confusion"]["rows"])
    return pictures


def _facts(said: dict[str, Any]) -> list[tuple[str, str]]:
    facts = [("p, nothing missing", f"{said['p_value']:.2g}")]
    if named := said["mechanisms"]:
        facts.insert(0, ("mechanism", str(escape(" and ".join(one["mechanism"] for one in named)))))
        facts.append(("probability", " and ".join(percent(one["probability"]) for one in named)))
    suffix, factor, unit = unit_of(said)
    held = said["fit"][f"heldout_rmse_{suffix}"]
    errors = [f"{factor * held[state]:.3g}" for state in ("refitted", "explained") if held[state] is not None]
    if errors:
        facts.append(("held-out error", f"{' → '.join(errors)} {unit}"))
    if improvement := said["fit"]["improvement"]:
        low, high = (100.0 * value for value in improvement["interval_95"])
        facts.append(("of it gone (95 %)", f"{100.0 * improvement['part']:.0f} % ({low:.0f} to {high:.0f})"))
    return facts


def _candidates(said: dict[str, Any]) -> Rows:
    """Every candidate that was tried, the most probable first."""
    suffix, factor, unit = unit_of(said)
    rows = []
    for one in said["ranking"]:
        if one["log_evidence"] is not None:
            held = one["heldout_rmse_change" if suffix == "m" else "heldout_rmse_change_pa"]
            seen = one["detectability"] if one["physics"] else None
            change = "" if held is None else f"{factor * held:+.2g} {unit}"
            numbers = [f"{one['log_evidence']:+.1f}", "" if seen is None else f"{seen:.1f}", change]
            name = Markup("<b>{}</b>").format(one["mechanism"])
            rows.append([name, percent(one["probability"]), *numbers, one["says"], one["rejected_because"]])
    return rows


def _fit(said: dict[str, Any]) -> Rows:
    """Errors of each state, at what was fitted, held out, and only checked; beside them what others would reach."""
    (suffix, factor, _), fit = unit_of(said), said["fit"]

    def cell(value: Any) -> str:
        if isinstance(value, dict):
            return ", ".join(f"{name} {cell(one)}" for name, one in value.items())
        return "" if value is None else f"{factor * value:.3g}"

    columns = [fit[f"{key}_{suffix}"] or {} for key in ("rmse", "heldout_rmse", "check_rmse")]
    rows = [
        [name, *(cell(of.get(state)) for of in columns)]
        for state, name in STATES.items()
        if columns[0][state] is not None
    ]
    if fit.get("ceiling_heldout_rmse_m") is not None:
        rows.append(["any smooth force without a name", "", cell(fit["ceiling_heldout_rmse_m"]), ""])
    if fit.get("placebo_heldout_rmse_m") is not None:
        between = " to ".join(map(cell, fit["placebo_heldout_rmse_m"]))
        rows.append(["nine of ten patterns that mean nothing, with as many parameters", "", between, ""])
    if fit.get("noise_rmse_m") is not None:
        rows.append(["what noise alone leaves", cell(fit["noise_rmse_m"]), "", ""])
    return rows


def _placebos(said: dict[str, Any]) -> list[str]:
    """How often patterns that mean nothing do as well as what was added."""
    fit, words = said["fit"], "pattern that means nothing does as well with p ="
    together = [] if fit.get("placebo_p") is None else [f"A {words} {fit['placebo_p']:.2g}."]
    return together or [f"{one['mechanism']}: a {words} {one['placebo_p']:.2g}." for one in fit["confirmations"]]


def _smallest(said: dict[str, Any]) -> Rows:
    """What these data would have shown of each mechanism."""
    rows = []
    for kind, one in said["smallest_detectable"].items():
        named = one.get("named_from")
        # of what is there or not there is no size
        of_size = named is not None and one["unit"] != "of being there"
        rows.append([kind, one["says"], f"{named:.2g} {one['unit']}" if of_size else ""])
    return rows


def _aside(recorded: Recorded) -> Rows:
    """Points that were set aside as gross errors, with their places."""
    points, first = np.unique(np.where(recorded["set_aside"] > 0, recorded["point"], -1), return_index=True)
    places = np.column_stack([recorded[f"{axis}_mm"] for axis in "xyz"])
    return [
        [recorded["recording"][row], point, ", ".join(f"{value:.1f}" for value in places[row])]
        for point, row in zip(points.tolist(), first.tolist(), strict=True)
        if recorded["set_aside"][row]
    ]
