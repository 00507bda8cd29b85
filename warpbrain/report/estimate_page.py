"""`report.html` of an estimate, and its figures: prior and posterior, observed against predicted, what is left."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from warpbrain.arrays import Floats
from warpbrain.atomic import write_text
from warpbrain.estimation.posterior import Marginal, Posterior, Prediction
from warpbrain.inference.calibration import percent
from warpbrain.recordings.recording import PointsRecording, SurfaceRecording
from warpbrain.report import views
from warpbrain.report.body_sections import before_and_after, body_view, fields_of, known_displacement
from warpbrain.report.comparison import SHOWN, explained
from warpbrain.report.estimate import averaged_row, parameter_row, prediction_row
from warpbrain.report.files import MILLIMETRES, read_state
from warpbrain.report.page import page
from warpbrain.report.page.figures import inlined, side_by_side
from warpbrain.report.picture import Moved, Pictures, begin_pictures, draw
from warpbrain.report.run_page import BADGES
from warpbrain.report.summary import left_out
from warpbrain.report.views import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILLION
from warpbrain.simulation.of_case import model_of

#: Causes that are less probable are not listed.
_LIKELY = 0.01


def write_estimate_page(folder: Path, summary: Mapping[str, Any], posterior: Posterior) -> Pictures | str:
    """Write `deformation.png` and `report.html` beside `state.vtu`; `summary` is what `estimate.json` holds.

    Returns the pictures, or why there are none.
    """
    case, nothing = summary["case"], summary["nothing_else"]
    # whether the estimate explains its recordings better than no motion at all
    judged = explained(
        [
            each | {key: each[f"root_mean_square_{key}"] for key in ("before", "after")}
            for each in summary["predictions"]
        ],
        "this estimate",
    )
    whole, state = posterior.case.mesh, read_state(folder / "state.vtu")
    # where the estimate, with its nuisances, has points that were recorded
    moved = Moved.of(posterior.case.recordings, ((p.name, p.rows, p.before, p.after) for p in posterior.predictions))
    subtitles = ["the most probable state of the estimate", *judged.sentences]
    begun = begin_pictures(posterior.case, state.u, moved)
    places = views.places(whole)
    agreement = None
    if any(prediction.kind != "surface" for prediction in posterior.predictions):
        agreement = inlined(lambda narrow: agreement_figure(posterior, narrow))
    causes = [] if nothing is None else [cause for cause in nothing["causes"] if cause["probability"] >= _LIKELY]
    pictures = draw(folder / "deformation.png", begun, case["title"], subtitles)
    sentences = [*summary["identifiability"]["sentences"], *judged.sentences]
    window = f"{case['name']}: tissue of {case['title']}"
    text = page(
        window, case["title"], judged.verdict, BADGES[judged.verdict], sentences,
        "estimate.html", summary=summary, judged=judged, agreement=agreement,
        tissue=[parameter_row(parameter) for parameter in summary["parameters"]],
        densities=inlined(lambda narrow: densities_figure(posterior, narrow)),
        causes=[[cause["name"], percent(cause["probability"])] for cause in causes],
        averaged=[] if nothing is None else [
            [f"{tissue}, {name}", middle, interval, unit]
            for tissue, name, middle, _, interval, unit in map(averaged_row, nothing["tissue"])
        ],
        recorded=[prediction_row(prediction) for prediction in summary["predictions"]],
        pictures=before_and_after(pictures),
        known=known_displacement(state, whole, places),
        view=body_view(state.mesh, state.u, fields_of(state), moved, places),
        left_out=left_out(model_of(posterior.case)),
        seconds=[[name, f"{value:.1f}"] for name, value in summary["seconds"].items()],
        files=[[name, Markup("<code>{}</code>").format(value)] for name, value in summary["inputs_sha256"].items()],
    )  # fmt: skip
    write_text(folder / "report.html", text)
    return pictures


_MARKERS = ("o", "s", "^", "D", "v", "P")
_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, BLACK)


def densities_figure(posterior: Posterior, narrow: bool) -> Any:
    """The density of each parameter before and after, one below the other for a narrow window."""
    count = len(posterior.marginals)
    figure, axes = side_by_side(count, narrow, 3.0, (max(4.6 * count, 6.4), 3.8))
    for column, marginal in enumerate(posterior.marginals):
        draws = None if posterior.chain is None else posterior.chain.theta[:, column]
        _draw_marginal(axes[column], marginal, posterior.prior.theta[:, column], draws)
    axes[0].legend(fontsize=9, frameon=False)
    return figure


def _draw_marginal(axes: Any, marginal: Marginal, prior: Floats, draws: Floats | None) -> None:
    from scipy.stats import gaussian_kde, norm

    modulus = marginal.parameter.is_modulus
    low, high = np.percentile(prior, [0.5, 99.5])
    low, high = min(low, marginal.interval[0]), max(high, marginal.interval[1])
    fine = np.linspace(marginal.mean - 5 * marginal.deviation, marginal.mean + 5 * marginal.deviation, 301)
    at = np.sort(np.concatenate([np.linspace(low, high, 400), fine[(fine >= low) & (fine <= high)]]))
    before = gaussian_kde(prior)(at)
    spread = draws is not None and float(np.ptp(draws)) > 0.0
    after = gaussian_kde(draws)(at) if spread else norm.pdf(at, marginal.mean, marginal.deviation)
    shown = np.exp(at) if modulus else at
    # each is as high as the other: what counts is where they are and how wide
    axes.fill_between(shown, before / before.max(), color=ORANGE, alpha=0.35, linewidth=0)
    axes.plot(shown, before / before.max(), color=ORANGE, linestyle="--", label="prior")
    axes.plot(shown, after / after.max(), color=BLUE, label="posterior")
    for end in marginal.interval:
        axes.axvline(np.exp(end) if modulus else end, color=BLUE, linewidth=0.8, linestyle=":")
    if modulus:
        axes.set_xscale("log")
    name = "shear modulus [Pa]" if modulus else f"{marginal.parameter.coordinate.name} [1]"
    axes.set_xlabel(f"{marginal.parameter.tissue}: {name}")
    axes.set_ylabel("density, relative to its top")
    axes.set_ylim(0.0, 1.15)


def agreement_figure(posterior: Posterior, narrow: bool) -> Any:
    """Components as they were observed and as they are predicted, one unit below the other for a narrow window."""
    # a distance to a surface has no sign that was recorded: before, after is all there is to compare
    shown = [prediction for prediction in posterior.predictions if prediction.kind != "surface"]
    units = list(dict.fromkeys(prediction.unit for prediction in shown)) or ["m"]
    figure, axes = side_by_side(len(units), narrow, 5.0, (5.4 * len(units), 6.2))
    for panel, unit in zip(axes, units, strict=True):
        _draw_pairs(panel, [prediction for prediction in shown if prediction.unit == unit], unit, 1 if narrow else 2)
    return figure


def _draw_pairs(axes: Any, predictions: Sequence[Prediction], unit: str, columns: int) -> None:
    factor, name = SHOWN[unit]
    ends = [0.0]
    for number, prediction in enumerate(predictions):
        observed, predicted = factor * prediction.before, factor * (prediction.before - prediction.after)
        ends += [float(observed.min()), float(observed.max()), float(predicted.min()), float(predicted.max())]
        label, gross = f"{prediction.name} ({prediction.role})", prediction.gross
        style = {"s": 12, "marker": _MARKERS[number % 6], "linewidths": 0.6}
        hollow = {"facecolors": "none", "edgecolors": _COLOURS[number % 6]}
        axes.scatter(predicted[~gross], observed[~gross], label=label, **hollow, **style)
        if gross.any():
            axes.scatter(predicted[gross], observed[gross], color=VERMILLION, label=f"{label}: gross errors", **style)
    margin = 0.05 * (max(ends) - min(ends) or 1.0)
    ends = [min(ends) - margin, max(ends) + margin]
    axes.plot(ends, ends, color="0.4", linewidth=0.8)
    axes.set_xlim(*ends)
    axes.set_ylim(*ends)
    axes.set_aspect("equal")
    quantity = "force" if unit == "N" else "displacement"
    axes.set_xlabel(f"predicted {quantity}, each component [{name}]")
    axes.set_ylabel(f"observed {quantity}, each component [{name}]")
    if predictions:
        axes.legend(fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncol=columns)
    else:
        axes.text(0.5, 0.5, "only surfaces were recorded", ha="center", transform=axes.transAxes)


def residuals_figure(posterior: Posterior) -> Any:
    """How far each recorded point is from its prediction, on the outlines of the anatomy from three sides."""
    whole, mesh = posterior.case.mesh, posterior.case.remaining[0]
    recordings, rows = {recording.name: recording for recording in posterior.case.recordings}, [np.empty((0, 4))]
    for prediction in posterior.predictions:
        if isinstance(recording := recordings[prediction.name], PointsRecording | SurfaceRecording):
            left = MILLIMETRES * np.linalg.norm(prediction.after, axis=1)
            rows.append(np.column_stack([recording.points[prediction.rows], left]))
    points, lengths = np.concatenate(rows)[:, :3], np.concatenate(rows)[:, 3]
    order, top = np.argsort(lengths), max(float(np.percentile(lengths, 98)), 1e-3) if len(lengths) else 1.0
    figure, axes = views.panels(1, 3, (13.5, 5.0))
    shown: Any = None
    places = views.places(whole)
    for panel, view, place in zip(axes, views.VIEWS, places, strict=True):
        views.draw_outline(panel, mesh, view, place, colour="0.45")
        flat = views.in_view(points[order][:, view.plane])
        shown = panel.scatter(
            flat[:, 0], flat[:, 1], c=lengths[order], s=16, cmap="viridis_r", vmin=0.0, vmax=top, edgecolors="0.2",
            linewidths=0.3, zorder=3,
        )  # fmt: skip
        views.frame(panel, whole, view)
        panel.set_title(f"outline at {views.heading(whole, view, place)}", fontsize=10)
    label = "distance between observed and predicted [mm], points of all depths"
    figure.colorbar(shown, ax=axes, location="bottom", shrink=0.5, aspect=40, pad=0.03, label=label)
    return figure
