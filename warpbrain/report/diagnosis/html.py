"""`report.html`: one file that says what a diagnosis found, made from the files beside it; it needs no network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from warpbrain.inference.decide import CANNOT_SAY, GROUP, NAMED, NAMED_AND_REST, NOT_PHYSICS, NOTHING, UNKNOWN
from warpbrain.inference.probability import percent
from warpbrain.report.diagnosis.figures.agreement import agreement_figure
from warpbrain.report.diagnosis.figures.confusion import confusion_figure
from warpbrain.report.diagnosis.figures.curves import curves_figure
from warpbrain.report.diagnosis.figures.map import map_figure
from warpbrain.report.diagnosis.figures.residuals import residuals_figure
from warpbrain.report.diagnosis.figures.slices import centre_of
from warpbrain.report.diagnosis.saved import Rows, Saved, read_saved, unit_of
from warpbrain.report.diagnosis.scene import view_of
from warpbrain.report.diagnosis.tables import (
    aside_table,
    candidates_table,
    fit_table,
    next_table,
    rejected_table,
    smallest_table,
)
from warpbrain.report.diagnosis.text import when_in_words
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.generative.page import BLACK, BLUE, GREEN, ORANGE, PURPLE, QUIET, SKY
from warpbrain.report.known_displacement import known_displacement
from warpbrain.report.page.document import Section, document, header, listed, section, text, write_document
from warpbrain.report.page.tables import table
from warpbrain.report.page.viewer import viewer
from warpbrain.report.views import VIEWS

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

#: What the standard deviation of the displacement is of.
_KNOWN = (
    "It is what is not known of tissue, of the case's loads and of what is named, to first order about the state with "
    "all that is named: what is left without a name is not in it, nor the error of the mesh."
)
_CANDIDATES = (
    '<p class="note">d says how visible an effect of the size that was fitted is in these data, in standard deviations '
    "of noise and all that is no physics: below about 4 nothing is found. Held-out error: its change against the "
    "refitted tissue alone; only the most probable are refitted without linearising.</p>"
)


def write_page(folder: Path) -> None:
    """Write `report.html` of the diagnosis that lies in a folder.

    Raises
    ------
    InputError
        If there is none in it.
    """
    write_document(folder / "report.html", page_of(read_saved(folder)))


def page_of(saved: Saved) -> str:
    """The page."""
    summary = saved.summary
    smallest = (
        "<p>The smallest effect that nine of ten times would raise an alarm, at a middling place.</p>",
        smallest_table(summary),
    )
    sections = [
        _before_and_after(saved),
        section("In three dimensions", _view(saved)),
        section("Candidates", _CANDIDATES, candidates_table(summary)),
        _where(saved),
        _known(saved),
        _apart(summary),
        section("What to measure next", _next(summary)),
        section("What these data would have shown", *(smallest if summary["smallest_detectable"] else ())),
        _assumptions(saved),
    ]
    verdict = summary["verdict"]
    return document(f"{verdict}: {summary['case']['title']}", _verdict(summary), sections, _BADGES[verdict])


def _verdict(summary: dict[str, Any]) -> str:
    facts = [("p, nothing missing", f"{summary['p_value']:.2g}")]
    if summary["mechanism"]:
        # a specimen's says all that it names in another place
        named = summary.get("mechanisms") or [summary]
        facts.insert(0, ("mechanism", text(" and ".join(one["mechanism"] for one in named))))
        facts.append(("probability", " and ".join(percent(one["probability"]) for one in named)))
    unit = unit_of(summary)
    held = summary["fit"][f"heldout_rmse_{unit.suffix}"]
    if held.get("refitted") is not None:
        before = f"{unit.factor * held['refitted']:.3g}"
        after = f" → {unit.factor * held['explained']:.3g}" if held.get("explained") is not None else ""
        facts.append(("held-out error", f"{before}{after} {unit.name}"))
    improvement = summary["fit"]["improvement"]
    if improvement is not None:
        low, high = (100.0 * value for value in improvement["interval_95"])
        facts.append(("of it gone (95 %)", f"{100.0 * improvement['part']:.0f} % ({low:.0f} to {high:.0f})"))
    return header(summary["case"]["title"], summary["verdict"], [summary["sentence"]], facts)


def _before_and_after(saved: Saved) -> Section:
    summary = saved.summary
    parts = []
    if saved.anatomy is not None and saved.rows is not None and _has_points(saved.rows):
        parts.append(residuals_figure(summary, saved.anatomy, saved.rows))
    if saved.curves is not None:
        parts.append(curves_figure(saved.curves))
    parts.append(fit_table(summary))
    fit = summary["fit"]
    placebos = [("A", fit.get("placebo_p"))]
    # of a specimen each addition has its own
    placebos += [(f"{text(one['mechanism'])}: a", one["placebo_p"]) for one in fit.get("confirmations", ())]
    known = [(whose, p) for whose, p in placebos if p is not None]
    parts += [f"<p>{whose} pattern that means nothing does as well with p = {p:.2g}.</p>" for whose, p in known]
    if saved.rows is not None and (saved.rows.lengths & ~(saved.rows["set_aside"] > 0.0)).any():
        parts.append(agreement_figure(summary, saved.rows))
    return section("Before and after", *parts)


def _has_points(rows: Rows) -> bool:
    """Whether there are points to draw: recorded ones that are not all set aside."""
    return bool(rows.lengths.any()) and not rows.vectors.aside.all()


def _view(saved: Saved) -> str:
    if saved.anatomy is None:
        return ""
    rows = saved.rows if saved.rows is not None and _has_points(saved.rows) else None
    note = "Arrows go from the computed to the observed place."
    return viewer(view_of(saved.summary, saved.anatomy, rows), "what is left", note)


def _known(saved: Saved) -> Section:
    if saved.state is None or saved.anatomy is None:
        return section("How well the displacement is known")
    centre = centre_of(saved.summary, saved.anatomy)
    places = [float(centre[view.axis]) for view in VIEWS]
    return known_displacement(saved.state, saved.anatomy.mesh, places, _KNOWN)


def _where(saved: Saved) -> Section:
    summary, where = saved.summary, saved.summary["where"]
    parts = []
    if where is None:
        parts.append("<p>No place stands out: the mismatch is everywhere a little, or nothing is missing.</p>")
    elif "centre_m" in where:
        x, y, z = (MILLIMETRES * value for value in where["centre_m"])
        parts.append(
            f"<p>The mismatch is largest about ({x:z.1f}, {y:z.1f}, {z:z.1f}) mm in RAS, within "
            f"{MILLIMETRES * where['radius_m']:.1f} mm; p = {where['global_p']:.2g}, looking everywhere.</p>"
        )
    else:
        low, high = where["strain"]
        parts.append(
            f"<p>It shows most in {text(where['test'])} ({text(where['mode'])}), {text(where['segment'])}, at "
            f"stretches or shears from {low:.3g} to {high:.3g}.</p>"
        )
    if summary.get("when") is not None:
        parts.append(f"<p>When: {text(when_in_words(summary['when']))}.</p>")
    if saved.anatomy is not None:
        parts.append(map_figure(summary, saved.anatomy))
    return section("Where", *parts)


def _apart(summary: dict[str, Any]) -> Section:
    if len(summary["group"]) > 1:
        chances = {one["mechanism"]: one["probability"] for one in summary["ranking"]}
        members = "".join(
            f"<li><b>{text(kind)}</b>: probability {percent(chances.get(kind, 0.0))}</li>" for kind in summary["group"]
        )
        first = f"<p>These data do not tell these apart:</p><ul>{members}</ul>"
    else:
        first = "<p>No few mechanisms share the probability among them.</p>"
    return section("What cannot be told apart", first, _confusion(summary), rejected_table(summary))


def _confusion(summary: dict[str, Any]) -> str:
    confusion = summary.get("confusion")
    if not confusion:
        return ""
    sentences = "".join(f"<p>{text(one)}</p>" for one in confusion["says"])
    return f"<h3>What could be taken for what</h3>{sentences}{confusion_figure(confusion)}"


def _next(summary: dict[str, Any]) -> str:
    if not summary["next_measurement"]:
        return "<p>There are no two mechanisms between which a measurement would decide.</p>"
    return (
        "<p>By how much each is expected to tell the two most probable mechanisms apart: a log Bayes factor of 3 is "
        f"strong, of 5 decisive.</p>{next_table(summary)}"
    )


def _assumptions(saved: Saved) -> Section:
    summary = saved.summary
    remarks = listed(summary["remarks"])
    files = table(
        ("file", "SHA-256"), [[text(k), f"<code>{text(v)}</code>"] for k, v in summary["inputs_sha256"].items()]
    )
    options = ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in summary["options"].items())
    versions = ", ".join(f"{key} {value}" for key, value in summary["versions"].items())
    seconds = sum(summary["seconds"].values())
    return section(
        "What was assumed",
        listed(summary["assumptions"]),
        f"<h3>Remarks</h3>{remarks}" if remarks else "",
        aside_table(saved.rows),
        "<h3>How it was made</h3>",
        f"<p>Options: {text(options)}.<br>Versions: {text(versions)}.<br>{seconds:.0f} s on "
        f"{text(summary['device'])}.</p>",
        files,
        '<p class="note">All numbers of this page: <code>diagnosis.json</code>, <code>points.csv</code> and '
        "<code>map.vtu</code> beside it.</p>"
        if saved.anatomy is not None
        else '<p class="note">All numbers of this page: <code>diagnosis.json</code> beside it.</p>',
    )
