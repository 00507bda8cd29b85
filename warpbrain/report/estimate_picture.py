"""Figures of an estimate: prior and posterior, observed against predicted, and residuals on the anatomy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.posterior import Marginal, Posterior
from warpbrain.estimation.prediction import Prediction
from warpbrain.mesh import boundary_faces
from warpbrain.recordings.recording import PointsRecording, SurfaceRecording
from warpbrain.report import views
from warpbrain.report.comparison import SHOWN
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.page.figures import NARROW

#: Of Okabe and Ito, who can be told apart by everybody and in grey print.
PRIOR, POSTERIOR, GROSS = "#E69F00", "#0072B2", "#D55E00"
_MARKERS = ("o", "s", "^", "D", "v", "P")
_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#000000")


def write_prior_and_posterior(path: Path, posterior: Posterior) -> None:
    """Draw the density of each parameter before and after."""
    _save(path, densities_figure(posterior, False), posterior)


def densities_figure(posterior: Posterior, narrow: bool) -> Any:
    """The density of each parameter before and after, one below the other for a narrow window."""
    from matplotlib.figure import Figure

    marginals = posterior.marginals
    count = len(marginals)
    size = (NARROW, 3.0 * count) if narrow else (max(4.6 * count, 6.4), 3.8)
    figure = Figure(figsize=size, layout="constrained", facecolor="white")
    axes = figure.subplots(*((count, 1) if narrow else (1, count)), squeeze=False).ravel()
    for column, marginal in enumerate(marginals):
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
    axes.fill_between(shown, before / before.max(), color=PRIOR, alpha=0.35, linewidth=0)
    axes.plot(shown, before / before.max(), color=PRIOR, linestyle="--", label="prior")
    axes.plot(shown, after / after.max(), color=POSTERIOR, label="posterior")
    for end in marginal.interval:
        axes.axvline(np.exp(end) if modulus else end, color=POSTERIOR, linewidth=0.8, linestyle=":")
    if modulus:
        axes.set_xscale("log")
    name = "shear modulus [Pa]" if modulus else f"{marginal.parameter.coordinate.name} [1]"
    axes.set_xlabel(f"{marginal.parameter.tissue}: {name}")
    axes.set_ylabel("density, relative to its top")
    axes.set_ylim(0.0, 1.15)


def write_observed_against_predicted(path: Path, posterior: Posterior) -> None:
    """Draw every component of every recording beside what the estimate makes of it; a panel for each unit."""
    _save(path, agreement_figure(posterior, False), posterior)


def agreement_figure(posterior: Posterior, narrow: bool) -> Any:
    """Components as they were observed and as they are predicted, one unit below the other for a narrow window."""
    from matplotlib.figure import Figure

    # a distance to a surface has no sign that was recorded: before, after is all there is to compare
    shown = [one for one in posterior.predictions if one.kind != "surface"]
    units = list(dict.fromkeys(one.unit for one in shown)) or ["m"]
    count = len(units)
    size = (NARROW, 5.0 * count) if narrow else (5.4 * count, 6.2)
    figure = Figure(figsize=size, layout="constrained", facecolor="white")
    axes = figure.subplots(*((count, 1) if narrow else (1, count)), squeeze=False).ravel()
    for column, unit in enumerate(units):
        _draw_pairs(axes[column], [one for one in shown if one.unit == unit], unit, 1 if narrow else 2)
    return figure


def _save(path: Path, figure: Any, posterior: Posterior) -> None:
    # the title is the user's free text, in which a dollar sign begins no formula
    figure.suptitle(posterior.case.title, parse_math=False, fontsize=10)
    views.save(figure, path)


def _draw_pairs(axes: Any, predictions: Sequence[Prediction], unit: str, columns: int) -> None:
    factor, name = SHOWN[unit]
    ends = [0.0]
    for number, one in enumerate(predictions):
        observed, predicted = factor * one.before, factor * (one.before - one.after)
        ends += [float(observed.min()), float(observed.max()), float(predicted.min()), float(predicted.max())]
        label = f"{one.name} ({one.role})"
        style = {"s": 12, "marker": _MARKERS[number % 6], "linewidths": 0.6}
        good = ~one.gross
        axes.scatter(
            predicted[good], observed[good], facecolors="none", edgecolors=_COLOURS[number % 6], label=label, **style
        )
        if one.gross.any():
            axes.scatter(
                predicted[one.gross], observed[one.gross], color=GROSS, label=f"{label}: gross errors", **style
            )
    margin = 0.05 * (max(ends) - min(ends) or 1.0)
    ends = [min(ends) - margin, max(ends) + margin]
    axes.plot(ends, ends, color="0.4", linewidth=0.8)
    axes.set_xlim(*ends)
    axes.set_ylim(*ends)
    axes.set_aspect("equal")
    what = "force" if unit == "N" else "displacement"
    axes.set_xlabel(f"predicted {what}, each component [{name}]")
    axes.set_ylabel(f"observed {what}, each component [{name}]")
    if predictions:
        axes.legend(fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncol=columns)
    else:
        axes.text(0.5, 0.5, "only surfaces were recorded", ha="center", transform=axes.transAxes)


def write_residuals(path: Path, posterior: Posterior) -> None:
    """Draw how far each recorded point is from its prediction, on the outlines of the anatomy from three sides."""
    from matplotlib.figure import Figure

    mesh = posterior.case.remaining[0]
    faces = boundary_faces(mesh.tetrahedra)
    points, lengths = _places(posterior)
    figure = Figure(figsize=(13.5, 5.0), layout="constrained")
    axes = figure.subplots(1, 3)
    top = max(float(np.percentile(lengths, 98)), 1e-3) if len(lengths) else 1.0
    shown: Any = None
    order = np.argsort(lengths)
    for column, (view, place) in enumerate(
        zip(views.VIEWS, views.places(posterior.case.mesh, views.resected_elements(posterior.case.mesh)), strict=True)
    ):
        views.draw_outline(axes[column], faces, mesh.points, view, place, colour="0.45")
        flat = views.in_view(points[order][:, view.plane])
        shown = axes[column].scatter(
            flat[:, 0], flat[:, 1], c=lengths[order], s=16, cmap="viridis_r", vmin=0.0, vmax=top, edgecolors="0.2",
            linewidths=0.3, zorder=3,
        )  # fmt: skip
        views.frame(axes[column], posterior.case.mesh, view)
        axes[column].set_title(f"outline at {views.heading(posterior.case.mesh, view, place)}", fontsize=10)
    bar = figure.colorbar(shown, ax=axes, location="bottom", shrink=0.5, aspect=40, pad=0.03)
    bar.set_label("distance between observed and predicted [mm], points of all depths")
    figure.suptitle(posterior.case.title, parse_math=False)
    views.save(figure, path)


def _places(posterior: Posterior) -> tuple[Floats, Floats]:
    """Recorded positions (n, 3) [m] and lengths of the residuals (n,) [mm]."""
    recordings = {recording.name: recording for recording in posterior.case.recordings}
    points, lengths = [np.empty((0, 3))], [np.empty(0)]
    for one in posterior.predictions:
        recording = recordings[one.name]
        if isinstance(recording, PointsRecording | SurfaceRecording):
            points.append(recording.points[one.rows])
            lengths.append(MILLIMETRES * np.linalg.norm(one.after, axis=1))
    return np.concatenate(points), np.concatenate(lengths)
