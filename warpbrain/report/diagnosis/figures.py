"""Still figures of a diagnosis beside those of the anatomy: agreement, what imitates what, curves of tests."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from warpbrain.physics.words import length
from warpbrain.report.diagnosis.description import STATES
from warpbrain.report.diagnosis.files import Recorded
from warpbrain.report.generative.page import BLACK, BLUE, ORANGE, VERMILLION
from warpbrain.report.page.figures import NARROW, TEXT, WIDTH, inlined, panels, shades
from warpbrain.worlds.specimen.protocol import Test
from warpbrain.worlds.specimen.result import SpecimenDiagnosis

#: Colours, markers and lines of the states of a case; in grey print the first is the darkest.
COLOURS = {"declared": VERMILLION, "refitted": ORANGE, "explained": BLUE}
_MARKERS = {"declared": "x", "refitted": "+", "explained": "o"}
_STYLES = {"declared": ":", "refitted": "--", "explained": "-"}
#: A part below the first is not written; above the second letters are white.
_SHOWN, _DARK = 0.01, 0.55


def agreement_figure(summary: dict[str, Any], recorded: Recorded) -> str:
    """Observed beside computed, one panel a state, on common scales: every component of a displacement."""
    from matplotlib.ticker import MaxNLocator

    shown, observed = recorded.states, recorded["observed"][recorded.counted]
    computed = {state: recorded[state][recorded.counted] for state in shown}
    ends = np.concatenate([observed, *computed.values()])
    margin = 0.05 * float(np.ptp(ends)) or 1.0
    limits = (float(ends.min()) - margin, float(ends.max()) + margin)
    errors = {state: length(summary["fit"]["rmse_m"][state]) for state in shown}

    def draw(narrow: bool) -> Any:
        figure, axes = panels(narrow, 3.6, len(shown), sharex=True, sharey=True, width=2.75 * len(shown))
        for panel, state in zip(axes, shown, strict=True):
            panel.plot(
                computed[state], observed, _MARKERS[state], markersize=4.0, color=COLOURS[state], fillstyle="none",
                markeredgewidth=0.8,
            )  # fmt: skip
            panel.plot(limits, limits, color=BLACK, linewidth=0.8)
            panel.set(xlim=limits, ylim=limits, aspect="equal")
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
    listed = ", ".join(f"{STATES[state]} {error}" for state, error in errors.items())
    return inlined(draw, f"Observed beside computed displacements; RMSE {listed}.", caption)


def confusion_figure(rows: dict[str, dict[str, float]]) -> str:
    """Rows: what acts; columns: what imitates it; in the cells percent of what is visible."""
    columns = list(dict.fromkeys(name for row in rows.values() for name in row))
    shares = np.array([[row.get(name, np.nan) for name in columns] for row in rows.values()], dtype=float)

    def draw(narrow: bool) -> Any:
        figure, (axes,) = panels(narrow, 1.6 + 0.27 * len(rows))
        size = TEXT - 2.5 if narrow else TEXT
        axes.imshow(np.ma.masked_invalid(shares), cmap=shades(), vmin=0.0, vmax=1.0, aspect="auto")
        for row, column in np.argwhere(shares >= _SHOWN).tolist():
            colour = "white" if shares[row, column] > _DARK else BLACK
            text = f"{100.0 * shares[row, column]:.0f}"
            axes.text(column, row, text, ha="center", va="center", fontsize=size - 1, color=colour)
        axes.set_xticks(range(len(columns)), columns, rotation=55, ha="right", rotation_mode="anchor", fontsize=size)
        axes.set_yticks(range(len(rows)), list(rows), fontsize=size)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.set_xlabel("what imitates it", fontsize=TEXT)
        axes.set_ylabel("what acts", fontsize=TEXT)
        return figure

    caption = (
        "Percent of the visible effect of each mechanism, at its middling place, that the best place of another cause "
        "imitates: near 100 these data cannot tell the two apart, however large the effect is."
    )
    pairs = [(part, kind, other) for kind, row in rows.items() for other, part in row.items()]
    most = ", ".join(f"{kind} by {other} {100.0 * part:.0f} %" for part, kind, other in sorted(pairs, reverse=True)[:4])
    return inlined(draw, f"How much of each mechanism others imitate; most: {most}.", caption)


def curves_figure(diagnosis: SpecimenDiagnosis) -> str:
    """Stress of tests, recorded and computed: one panel a test, over strain, or over time where the strain is held."""
    from matplotlib.figure import Figure

    tests = diagnosis.protocol.tests

    def draw(narrow: bool) -> Any:
        columns = 1 if narrow else min(3, len(tests))
        lines = math.ceil(len(tests) / columns)
        size = (NARROW if narrow else WIDTH, 0.5 + 2.3 * lines)
        figure = Figure(figsize=size, layout="constrained", facecolor="white")
        grid = figure.subplots(lines, columns, squeeze=False).ravel()
        for panel, test, rows in zip(grid, tests, diagnosis.protocol.rows, strict=False):
            _curve(
                panel, test, {state: diagnosis.stresses[state][rows] for state in STATES if state in diagnosis.stresses}
            )
        for empty in grid[len(tests) :]:
            empty.set_visible(False)
        grid[0].legend(fontsize=TEXT - 2, frameon=False)
        return figure

    caption = (
        "Nominal stress of each test: dots were recorded, lines were computed. Tests marked check were not fitted."
    )
    return inlined(draw, f"Recorded and computed stress of {len(tests)} tests.", caption)


def _curve(panel: Any, test: Test, computed: dict[str, Any]) -> None:
    turns = np.any(np.diff(test.strain) * (test.strain[-1] - test.strain[0]) <= 0.0)
    x, label = (test.time, "time [s]") if turns and test.time is not None else (test.strain, "stretch or shear")
    panel.plot(x, test.stress, ".", color=BLACK, markersize=3.0, label="recorded")
    for state, values in computed.items():
        panel.plot(x, values, _STYLES[state], color=COLOURS[state], linewidth=1.5, label=STATES[state])
    panel.set_title(f"{test.name} ({test.mode}{'' if test.fitted else ', check'})", fontsize=TEXT)
    panel.set_xlabel(label, fontsize=TEXT - 1)
    panel.set_ylabel("stress [Pa]", fontsize=TEXT - 1)
    panel.tick_params(labelsize=TEXT - 2)
    panel.spines[["top", "right"]].set_visible(False)
