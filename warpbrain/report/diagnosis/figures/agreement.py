"""Observed beside computed, before and after."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.physics.words import length
from warpbrain.report.diagnosis.figures.states import COLOURS, MARKERS
from warpbrain.report.diagnosis.saved import STATES, Rows
from warpbrain.report.generative.page import BLACK
from warpbrain.report.page.figures import TEXT, inlined, panels


def agreement_figure(summary: dict[str, Any], rows: Rows) -> str:
    """One panel a state, on common scales: every component of a displacement that was recorded."""
    from matplotlib.ticker import MaxNLocator

    shown = [state for state in STATES if rows.has(state)]
    counted = rows.lengths & ~(rows["set_aside"] > 0.0)
    observed = rows["observed"][counted]
    computed = {state: rows[state][counted] for state in shown}
    ends = np.concatenate([observed, *computed.values()])
    margin = 0.05 * float(np.ptp(ends)) or 1.0
    low, high = float(ends.min()) - margin, float(ends.max()) + margin
    errors = {state: length(summary["fit"]["rmse_m"][state]) for state in shown}

    def draw(narrow: bool) -> Any:
        figure, axes = panels(narrow, 3.6, len(shown), sharex=True, sharey=True, width=2.75 * len(shown))
        for panel, state in zip(axes, shown, strict=True):
            panel.plot(
                computed[state], observed, MARKERS[state], markersize=4.0, color=COLOURS[state], fillstyle="none",
                markeredgewidth=0.8,
            )  # fmt: skip
            panel.plot([low, high], [low, high], color=BLACK, linewidth=0.8)
            panel.set_xlim(low, high)
            panel.set_ylim(low, high)
            panel.set_aspect("equal")
            for axis in (panel.xaxis, panel.yaxis):
                axis.set_major_locator(MaxNLocator(5))
            panel.set_title(f"{STATES[state]}\nRMSE {errors[state]}", fontsize=TEXT)
            panel.set_xlabel("computed [mm]", fontsize=TEXT)
        for panel in axes if narrow else axes[:1]:
            panel.set_ylabel("observed [mm]", fontsize=TEXT)
        return figure

    caption = (
        "Every component of displacement that was recorded, beside what was computed of it; on the line they agree. "
        "The refitted ones have registration and the error of the mesh taken off."
    )
    said = ", ".join(f"{STATES[state]} {error}" for state, error in errors.items())
    return inlined(draw, f"Observed beside computed displacements; RMSE {said}.", caption)
