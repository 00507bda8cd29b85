"""What is left at every recorded point, before and after, on a common scale, over a cut of the anatomy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from warpbrain.physics.words import length, number
from warpbrain.report.diagnosis.figures.slices import centre_of, draw_slice, frame_slice, millimetres
from warpbrain.report.diagnosis.figures.states import COLOURS
from warpbrain.report.diagnosis.saved import STATES, Anatomy, Rows
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.generative.page import BLACK
from warpbrain.report.page.figures import TEXT, inlined, panels
from warpbrain.report.views import VIEWS, in_view, scale_length

#: Length of the arrow of a large residual, as a part of the size of the body.
_LONG = 0.16


def residuals_figure(summary: dict[str, Any], anatomy: Anatomy, rows: Rows) -> str:
    """One panel a state."""
    vectors = rows.vectors
    counted = ~vectors.aside
    shown = list(vectors.left)
    first = vectors.left[shown[0]][counted]
    # the cut in whose plane most of the mismatch lies
    view = max(VIEWS, key=lambda one: float(np.sum(first[:, one.plane] ** 2)))
    centre = centre_of(summary, anatomy)
    place = float(centre[view.axis])
    size = float(np.ptp(anatomy.mesh.points, axis=0).max())
    large = float(np.quantile(np.linalg.norm(first, axis=1), 0.95)) or 1e-3
    enlarged = _LONG * size / large
    across, high = np.ptp(anatomy.mesh.points[:, view.plane], axis=0)
    errors = {state: length(summary["fit"]["rmse_m"][state]) for state in shown}
    key = _round(MILLIMETRES * large)

    def draw(narrow: bool) -> Any:
        figure, axes = panels(narrow, 0.9 + 2.8 * float(high / across), len(shown), width=3.0 * len(shown))
        for panel, state in zip(axes, shown, strict=True):
            draw_slice(panel, anatomy, view, place, summary["map"]["threshold"])
            start = in_view(vectors.where[:, view.plane])
            along = in_view(vectors.left[state][:, view.plane]) * enlarged
            panel.quiver(
                *start[counted].T, *along[counted].T, angles="xy", scale_units="xy", scale=1.0, color=COLOURS[state],
                width=0.009, headwidth=3.6, headlength=4.2, headaxislength=3.8, zorder=5,
            )  # fmt: skip
            panel.plot(*start[counted].T, ".", color=BLACK, markersize=2.0, zorder=6)
            panel.plot(*start[vectors.aside].T, "x", color=BLACK, markersize=6.0, zorder=6)
            panel.set_title(f"{STATES[state]}\nRMSE {errors[state]}", fontsize=TEXT + 1)
            frame_slice(panel, anatomy, view)
        _key(axes[-1], anatomy, key, enlarged)
        return figure

    plane = f"{view.name}, {'xyz'[view.axis]} = {millimetres(place)}"
    times = np.unique(rows["time_s"][rows.lengths])
    when = f", at the last of {len(times)} times, {times[-1]:.3g} s" if len(times) > 1 else ""
    hidden = f" {int(vectors.aside.sum())} set aside: cross." if vectors.aside.any() else ""
    caption = (
        f"What is left at each of {len(vectors.where)} recorded points: arrows from the computed to the observed "
        f"place, {number(enlarged, 2)} times as long as they are, on a common scale, all points seen in the plane of a "
        f"cut ({plane}){when}.{hidden} Green: where a force is significant. Hatched: the data cannot see a force there."
    )
    said = ", ".join(f"{STATES[state]} {error}" for state, error in errors.items())
    return inlined(draw, f"Arrows of what is left at recorded points; RMSE {said}.", caption)


def _key(axes: Any, anatomy: Anatomy, key: float, enlarged: float) -> None:
    """An arrow of a round length at the lower right."""
    length, bar = key * enlarged, scale_length(anatomy.mesh)
    right, low = axes.get_xlim()[1] - 0.1 * bar, axes.get_ylim()[0] + 0.15 * bar
    axes.quiver(
        [right - length], [low], [length], [0.0], angles="xy", scale_units="xy", scale=1.0, color=BLACK,
        width=0.009, headwidth=3.6, headlength=4.2, headaxislength=3.8,
    )  # fmt: skip
    axes.text(right - length - 0.1 * bar, low, f"{key:g} mm left", fontsize=8, ha="right", va="center", color="#333333")


def _round(value: float) -> float:
    """1, 2 or 5 and zeros, no more than a value."""
    decade = 10.0 ** math.floor(math.log10(value))
    return max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= value)
