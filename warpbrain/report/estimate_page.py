"""`report.html` of an estimate: the tissue, how well it is known, and what it makes of what was recorded."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.estimation.posterior import Posterior
from warpbrain.inference.probability import percent
from warpbrain.physics.words import tabled
from warpbrain.recordings.recording import PointsRecording
from warpbrain.report import views
from warpbrain.report.body_sections import before_and_after, fields_of, in_three_dimensions
from warpbrain.report.estimate_picture import agreement_figure, densities_figure
from warpbrain.report.explained import Explained, explained, number
from warpbrain.report.known_displacement import known_displacement
from warpbrain.report.page.document import Section, document, header, listed, section, text, write_document
from warpbrain.report.page.figures import inlined
from warpbrain.report.page.tables import table
from warpbrain.report.picture import Moved, Pictures
from warpbrain.report.run_page import BADGES, remarks, versions
from warpbrain.report.state_files import SavedState
from warpbrain.report.summary import left_out
from warpbrain.simulation.of_case import model_of

#: Causes that are less probable are not listed.
_LIKELY = 0.01
#: What the standard deviation of the displacement is of.
_KNOWN = (
    "It is what is not known of the tissue, to first order about this state: what else may act is not in it, nor the "
    "error of the mesh."
)
_METHODS = {"laplace": "Laplace's approximation", "chain": "a Markov chain"}


def moved_of(posterior: Posterior) -> Moved:
    """Points that were recorded, and where the estimate, with its nuisances, has them."""
    recordings = {one.name: one for one in posterior.case.recordings}
    found = [np.zeros((0, 9))]
    for one in posterior.predictions:
        recording = recordings[one.name]
        if isinstance(recording, PointsRecording):
            found.append(np.column_stack([recording.points[one.rows], one.before, one.before - one.after]))
    return Moved(*np.split(np.concatenate(found), 3, axis=1))


def judged_of(said: Mapping[str, Any]) -> Explained:
    """Whether an estimate explains its recordings better than no motion at all."""
    entries = [
        {**one, "before": one["root_mean_square_before"], "after": one["root_mean_square_after"]}
        for one in said["predictions"]
    ]
    return explained(entries, "this estimate")


def write_estimate_page(
    path: Path, said: Mapping[str, Any], posterior: Posterior, state: SavedState, pictures: Pictures | str
) -> None:
    """Write the page.

    Parameters
    ----------
    path : Path
    said : mapping
        What `estimate.json` holds.
    posterior : Posterior
    state : SavedState
        The most probable one, with what is not known of it.
    pictures : Pictures or str
        Or why there are none.
    """
    case, judged = said["case"], judged_of(said)
    whole = posterior.case.mesh
    drawn = None if isinstance(pictures, str) else pictures
    places = views.places(whole, views.resected_elements(whole))
    sections = [
        _tissue(said, posterior),
        section("What else may act", _causes(said)),
        _recordings(said, posterior),
        before_and_after(drawn, pictures if isinstance(pictures, str) else ""),
        known_displacement(state, whole, places, _KNOWN),
        in_three_dimensions(state.mesh, state.u, fields_of(state), moved_of(posterior), places),
        section("What the model leaves out", listed(left_out(model_of(posterior.case)))),
        _doubts(said),
        section("What was assumed", listed(case["assumptions"]), _prior(said)),
        _made(said),
    ]
    facts = [(text(_name(one)), _estimate(one)) for one in said["parameters"] if one["unit"] == "Pa"]
    if judged.before is not None:
        facts.append(("RMSE, no motion → this", f"{judged.before:.3g} → {judged.after:.3g} mm"))
    if said["nothing_else"] is not None:
        facts.append(("probability that nothing else acts", percent(said["nothing_else"]["probability"])))
    sentences = [*said["identifiability"]["sentences"], *judged.sentences]
    top = header(case["title"], judged.verdict, sentences, facts)
    write_document(path, document(f"{case['name']}: tissue of {case['title']}", top, sections, BADGES[judged.verdict]))


def _name(one: Mapping[str, Any]) -> str:
    return f"{one['tissue']}, {one['name']}"


def _estimate(one: Mapping[str, Any]) -> str:
    low, high = one["interval_95"]
    return f"{one['estimate']:.4g} {one['unit']} ({low:.4g} to {high:.4g})"


def _unit(one: Mapping[str, Any]) -> str:
    return "" if one["unit"] == "1" else str(one["unit"])


def _tissue(said: Mapping[str, Any], posterior: Posterior) -> Section:
    rows = []
    for one in said["parameters"]:
        (low, high), (prior_low, prior_high) = one["interval_95"], one["prior"]["interval_95"]
        rows.append(
            [
                text(one["tissue"]),
                text(one["name"]),
                f"{one['estimate']:.4g}",
                f"{one['standard_deviation']:.3g}",
                f"{low:.4g} to {high:.4g}",
                f"{prior_low:.4g} to {prior_high:.4g}",
                f"{100.0 * one['shrinkage']:.0f} %",
                text(_unit(one)),
            ]
        )
    head = ("tissue", "parameter", "estimate", "sd", "95 %", "prior 95 %", "of its spread gone", "unit")
    names, matrix = said["correlation"]["names"], said["correlation"]["matrix"]
    tied = [
        f"{names[i]} and {names[j]} are correlated: {matrix[i][j]:.2f}."
        for i in range(len(names))
        for j in range(i)
        if abs(matrix[i][j]) >= 0.3
    ]
    caption = "Each parameter before (dashed, filled) and after (line); dotted: the ends of its 95 % interval."
    names_of = ", ".join(_name(one) for one in said["parameters"])
    figure = inlined(lambda narrow: densities_figure(posterior, narrow), f"Prior and posterior of {names_of}.", caption)
    return section("Tissue", table(head, rows, numbers=range(2, 7)), listed(tied), figure)


def _causes(said: Mapping[str, Any]) -> str:
    nothing = said["nothing_else"]
    if nothing is None:
        return "<p>It was not asked what else may act.</p>"
    causes = [
        [text(one["name"]), percent(one["probability"])] for one in nothing["causes"] if one["probability"] >= _LIKELY
    ]
    tissue = [
        [
            text(_name(one)),
            f"{one['middle']:.4g}",
            f"{one['interval_95'][0]:.4g} to {one['interval_95'][1]:.4g}",
            text(_unit(one)),
        ]
        for one in nothing["tissue"]
    ]
    parts = [f"<p>Probability that nothing acts but what the case says: {percent(nothing['probability'])}.</p>"]
    if causes:
        parts.append(table(("what may act", "probability"), causes, numbers=(1,)))
    parts.append("<h3>Tissue averaged over what may act, to first order</h3>")
    parts.append(table(("parameter", "middle", "95 %", "unit"), tissue, numbers=(1, 2)))
    return "".join(parts)


def _recordings(said: Mapping[str, Any], posterior: Posterior) -> Section:
    rows = []
    for one in said["predictions"]:
        noise, cover = one["noise_root_mean_square"], one["coverage"] or {}
        rows.append(
            [
                text(one["name"]),
                f"{one['count']}",
                number(one["root_mean_square_before"], one["unit"]),
                number(one["root_mean_square_after"], one["unit"]),
                number(one["root_mean_square_of_run"], one["unit"]),
                "" if noise is None else number(noise, one["unit"]),
                *(f"{100.0 * cover[key]:.0f} %" if key in cover else "" for key in ("50 %", "95 %")),
                f"{len(one['gross_errors'])}",
                text(one["unit"]),
                "check" if one["role"] == "check" else "",
            ]
        )
    head = (
        *("recording", "rows", "nothing moves", "this estimate", "its state as a run", "noise alone"),
        *("in 50 %", "in 95 %", "gross errors", "unit", "role"),
    )
    caption = "Root mean square; how many components lie in their 50 % and 95 % intervals"
    parts = [table(head, rows, numbers=range(1, 9), caption=caption)]
    if any(one.kind != "surface" for one in posterior.predictions):
        words = "Every component that was recorded beside what the estimate makes of it; on the line they agree."
        parts.append(
            inlined(lambda narrow: agreement_figure(posterior, narrow), "Observed beside predicted components.", words)
        )
    return section("What was recorded", *parts)


def _doubts(said: Mapping[str, Any]) -> Section:
    check, noise = said["check_of_laplace"], said["likelihood"]["noise_scale"]
    sentences = [
        f"By {_METHODS[said['method']]}; Pareto k {check['pareto_k']:.2f} of {check['draws']} weighted draws, "
        f"{check['effective_draws']:.0f} of them effective, {check['without_equilibrium']} without equilibrium, "
        f"{check['unstable_laws']} of unstable laws.",
        *(f"Laplace's approximation fails: {doubt}" for doubt in check["doubts"]),
        f"Noise is {noise:.2f} times as large as declared.",
    ]
    mesh, registration = said["discretisation"], said["registration"]
    if mesh is not None:
        sentences.append(
            f"The error of the mesh is {mesh['amount']:.2f} ± {mesh['standard_deviation']:.2f} times what elements of "
            f"half the size change, {tabled(mesh['difference_root_mean_square_mm'])} mm root mean square."
        )
    if registration is not None:
        shift = ", ".join(f"{value:.2f}" for value in registration["shift_mm"])
        turn = ", ".join(f"{value:.2f}" for value in registration["turn_degrees"])
        sentences.append(f"What was recorded is shifted by ({shift}) mm and turned by ({turn}) degrees.")
    return section("How far it is to be believed", listed(sentences), remarks(said["remarks"]))


def _prior(said: Mapping[str, Any]) -> str:
    prior = said["prior"]
    groups = ", ".join(f"{group} ({law})" for group, law in zip(prior["groups"], prior["laws"], strict=True))
    return (
        f"<p>Prior: the generative model {text(prior['model'])} ({text(prior['variant'])}), {text(groups)}, Poisson "
        f"ratio {prior['poisson']:g}; {prior['draws']} draws.</p>"
    )


def _made(said: Mapping[str, Any]) -> Section:
    seconds = [[text(name), f"{value:.1f}"] for name, value in said["seconds"].items()]
    files = [[text(name), f"<code>{text(value)}</code>"] for name, value in said["inputs_sha256"].items()]
    return section(
        "How it was computed",
        f"<p>{sum(said['equilibria'].values())} equilibria on {text(said['device'])}; seed {said['seed']}.</p>",
        table(("stage", "time [s]"), seconds, numbers=(1,)),
        versions(said["versions"]),
        table(("file", "SHA-256"), files),
        '<p class="note">All numbers of this page: <code>estimate.json</code> and <code>predictions.csv</code>.</p>',
    )
