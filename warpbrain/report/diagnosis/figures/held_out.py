"""Errors at points that were held out: before, after, what a force without a name reaches, what meaningless ones do."""

from __future__ import annotations

from typing import Any

from warpbrain.report.diagnosis.figures.drawing import COLOURS, HATCHES, TEXT, inlined, panels
from warpbrain.report.diagnosis.saved import STATES
from warpbrain.report.diagnosis.units import unit_of
from warpbrain.report.generative.page import BLACK, GREEN, PALE, QUIET


def held_out_figure(summary: dict[str, Any]) -> str:
    """Bars of the held-out errors of each state, and how large noise alone would be."""
    fit, unit = summary["fit"], unit_of(summary)
    errors = {state: fit[f"heldout_rmse_{unit.suffix}"].get(state) for state in STATES}
    shown = {state: unit.factor * value for state, value in errors.items() if value is not None}
    figure, (axes,) = panels(0.9 + 0.42 * (len(shown) + 1))
    names = []
    for row, (state, value) in enumerate(shown.items()):
        axes.barh(row, value, 0.62, color=COLOURS[state], hatch=HATCHES[state], edgecolor="white", linewidth=0.0)
        axes.barh(row, value, 0.62, facecolor="none", edgecolor=BLACK, linewidth=0.6)
        axes.text(value, row, f" {value:.3g}", va="center", fontsize=TEXT)
        names.append(STATES[state])
    ceiling = fit.get(f"ceiling_heldout_rmse_{unit.suffix}")
    if ceiling is not None:
        axes.barh(len(names), unit.factor * ceiling, 0.62, facecolor="white", edgecolor=GREEN, linewidth=1.4)
        axes.text(unit.factor * ceiling, len(names), f" {unit.factor * ceiling:.3g}", va="center", fontsize=TEXT)
        names.append("any smooth force")
    words = [f"Root mean square {unit.error} of what was held out."]
    band = fit.get(f"placebo_heldout_rmse_{unit.suffix}")
    if band is not None:
        low, high = (unit.factor * value for value in band)
        axes.axvspan(low, high, color=PALE, alpha=0.7, zorder=0, linewidth=0)
        axes.text(0.5 * (low + high), -0.75, "patterns that\nmean nothing", fontsize=TEXT - 2, ha="center", va="center")
        words.append(
            f"Grey band: nine of ten patterns that mean nothing but have as many parameters ({low:.3g} to {high:.3g} "
            f"{unit.name})."
        )
    noise = fit.get(f"noise_rmse_{unit.suffix}")
    if noise is not None:
        axes.axvline(unit.factor * noise, color=QUIET, linestyle=(0, (4, 3)), linewidth=1.2)
        words.append(f"Dashed: the distance that noise alone leaves at a point, {unit.factor * noise:.3g} {unit.name}.")
    if ceiling is not None:
        words.append("Any smooth force: what a force without a name, as flexible as the data allow, would reach.")
    axes.set_yticks(range(len(names)), names, fontsize=TEXT)
    axes.set_ylim(len(names) - 0.5, -1.1 if band is not None else -0.6)
    axes.set_xlim(0.0, 1.12 * max([*shown.values(), unit.factor * (ceiling or 0.0)]))
    axes.set_xlabel(f"held-out error [{unit.name}]", fontsize=TEXT)
    alternative = "; ".join(f"{STATES[state]} {value:.3g} {unit.name}" for state, value in shown.items())
    return inlined(figure, f"Held-out errors as bars: {alternative}.", " ".join(words))
