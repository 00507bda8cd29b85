"""Stress of a specimen's tests: recorded, and computed before and after."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from warpbrain.report.diagnosis.figures.states import COLOURS
from warpbrain.report.diagnosis.saved import STATES, Rows
from warpbrain.report.generative.page import BLACK
from warpbrain.report.page.figures import NARROW, TEXT, WIDTH, inlined

_STYLES = {"declared": ":", "refitted": "--", "explained": "-"}


def curves_figure(rows: Rows) -> str:
    """One panel a test: over strain, or over time where the strain is held."""
    from matplotlib.figure import Figure

    tests = list(dict.fromkeys(rows["test"].tolist()))
    shown = [state for state in STATES if rows.has(f"{state}_pa")]

    def draw(narrow: bool) -> Any:
        columns = 1 if narrow else min(3, len(tests))
        lines = math.ceil(len(tests) / columns)
        figure = Figure(
            figsize=(NARROW if narrow else WIDTH, 0.5 + 2.3 * lines), layout="constrained", facecolor="white"
        )
        grid = figure.subplots(lines, columns, squeeze=False).ravel()
        for panel, test in zip(grid, tests, strict=False):
            own = rows["test"] == test
            strain, time = rows["strain"][own], rows["time_s"][own]
            turns = np.any(np.diff(strain) * (strain[-1] - strain[0]) <= 0.0)
            by_time = turns and not np.isnan(time).any()
            x = time if by_time else strain
            panel.plot(x, rows["recorded_pa"][own], ".", color=BLACK, markersize=3.0, label="recorded")
            for state in shown:
                values = rows[f"{state}_pa"][own]
                panel.plot(x, values, _STYLES[state], color=COLOURS[state], linewidth=1.5, label=STATES[state])
            role = rows["role"][own][0]
            panel.set_title(f"{test} ({rows['mode'][own][0]}{', check' if role == 'check' else ''})", fontsize=TEXT)
            panel.set_xlabel("time [s]" if by_time else "stretch or shear", fontsize=TEXT - 1)
            panel.set_ylabel("stress [Pa]", fontsize=TEXT - 1)
            panel.tick_params(labelsize=TEXT - 2)
            for side in ("top", "right"):
                panel.spines[side].set_visible(False)
        for empty in grid[len(tests) :]:
            empty.set_visible(False)
        grid[0].legend(fontsize=TEXT - 2, frameon=False)
        return figure

    caption = (
        "Nominal stress of each test: dots were recorded, lines were computed. Tests marked check were not fitted."
    )
    return inlined(draw, f"Recorded and computed stress of {len(tests)} tests.", caption)
