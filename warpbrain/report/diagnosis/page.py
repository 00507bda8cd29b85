"""`report.html`: one file that says what a diagnosis found. Its words are in `page/diagnosis.html`."""

from collections import defaultdict
from typing import Any

from warpbrain.diagnosis.result import Diagnosis
from warpbrain.inference.decide import CANNOT_SAY, GROUP, NAMED, NAMED_AND_REST, NOT_PHYSICS, NOTHING, UNKNOWN
from warpbrain.report.body_sections import known_displacement
from warpbrain.report.diagnosis import pictures, text
from warpbrain.report.diagnosis.files import Recorded
from warpbrain.report.files import SavedState
from warpbrain.report.page import page
from warpbrain.report.page.scene import viewer
from warpbrain.report.views import BLACK, BLUE, GREEN, ORANGE, PURPLE, QUIET, SKY, VIEWS
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


def page_of(
    diagnosis: Diagnosis | SpecimenDiagnosis,
    summary: dict[str, Any],
    state: SavedState | None = None,
    drawn: dict[str, Any] | None = None,
) -> str:
    """The page; `summary` is its `diagnosis.json`, `state` its `state.vtu`: how well the displacement is known.

    `drawn`: what `pictures_of` has made, if that was begun before.
    """
    recorded = Recorded.of(diagnosis) if isinstance(diagnosis, Diagnosis) else None
    drawn = pictures_of(diagnosis, summary) if drawn is None else drawn
    if state is not None and isinstance(diagnosis, Diagnosis):
        anatomy = pictures.Anatomy(diagnosis, summary)
        places = [float(anatomy.centre[view.axis]) for view in VIEWS]
        drawn = {**drawn, "known": known_displacement(state, anatomy.mesh, places)}
    title, verdict = summary["case"]["title"], summary["verdict"]
    return page(
        f"{verdict}: {title}",
        title,
        verdict,
        _BADGES[verdict],
        [summary["sentence"]],
        "diagnosis.html",
        summary=summary,
        pictures=defaultdict(str, drawn),
        shown=text.shown_of(summary),
        aside=[] if recorded is None else recorded.aside,
        chances={candidate["mechanism"]: candidate["probability"] for candidate in summary["ranking"]},
    )


def pictures_of(diagnosis: Diagnosis | SpecimenDiagnosis, summary: dict[str, Any]) -> dict[str, Any]:
    """Figures and the 3-D view by name, but for that of the state; of what was not recorded there are none."""
    if not isinstance(diagnosis, Diagnosis):
        return {"curves": pictures.curves_figure(diagnosis)}
    recorded = Recorded.of(diagnosis)
    anatomy = pictures.Anatomy(diagnosis, summary)
    drawn: dict[str, Any] = {"map": pictures.map_figure(anatomy)}
    points = recorded.lengths.any() and not recorded.vectors.aside.all()
    if points:
        drawn["residuals"] = pictures.residuals_figure(anatomy, recorded)
    if recorded.counted.any():
        drawn["agreement"] = pictures.agreement_figure(summary, recorded)
    view = pictures.view_of(anatomy, recorded if points else None)
    drawn["view"] = viewer(view, "what is left", "Arrows go from the computed to the observed place.")
    if summary["confusion"]["rows"]:
        drawn["confusion"] = pictures.confusion_figure(summary["confusion"]["rows"])
    return drawn
