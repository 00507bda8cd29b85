"""Where the mismatch is, and where the data could not see one: three cuts through what was located."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.report.diagnosis.figures.slices import centre_of, draw_slice, frame_slice, millimetres
from warpbrain.report.diagnosis.saved import Anatomy
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.generative.page import BLACK
from warpbrain.report.page.figures import TEXT, inlined, panels, shades
from warpbrain.report.views import VIEWS, in_view


def map_figure(summary: dict[str, Any], anatomy: Anatomy) -> str:
    """Scores as colours, with the threshold of significance as a line and the located ball as a dashed circle."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Circle

    threshold = summary["map"]["threshold"]
    centre = centre_of(summary, anatomy)
    largest = max(float(np.max(anatomy.fields["score"])), threshold)

    def draw(narrow: bool) -> Any:
        figure, axes = panels(narrow, 3.6, 3)
        tint: Any = None
        for panel, view in zip(axes, VIEWS, strict=True):
            place = float(centre[view.axis])
            section = draw_slice(panel, anatomy, view, place, threshold)
            tint = PolyCollection(
                [in_view(p) for p in section.polygons], array=section.values, cmap=shades(), linewidths=0.2,
                edgecolors="face", zorder=1.0,
            )  # fmt: skip
            tint.set_clim(0.0, largest)
            panel.add_collection(tint)
            where = summary["where"]
            if where is not None and "centre_m" in where:
                across, up = in_view(centre[view.plane]).tolist()
                radius = MILLIMETRES * where["radius_m"]
                panel.add_patch(
                    Circle((across, up), radius, facecolor="none", edgecolor=BLACK, linestyle="--", linewidth=1.3)
                )
            panel.set_title(f"{view.name}, {'xyz'[view.axis]} = {millimetres(place)}", fontsize=TEXT)
            frame_slice(panel, anatomy, view)
        bar = figure.colorbar(
            tint,
            ax=axes,
            orientation="horizontal",
            shrink=0.9 if narrow else 0.5,
            aspect=40,
            pad=0.01 if narrow else 0.02,
        )
        bar.set_label("score of a force there\n(chi-squared of 3 degrees of freedom)", fontsize=TEXT - 1)
        bar.ax.tick_params(labelsize=TEXT - 2)
        bar.ax.axvline(threshold, color=BLACK, linewidth=1.6)
        return figure

    blind = summary["map"]["blind_above_n"]
    verdict = "is" if summary["map"]["significant"] else "is not"
    caption = (
        "How strongly a force at each place would explain the mismatch. The largest score, "
        f"{summary['map']['largest']:.1f}, {verdict} above the threshold of {threshold:.1f} that pays for looking at "
        f"{summary['map']['places']} places (bar; green line). Dashed: the ball that was located. Hatched: a force of "
        f"{blind:.2g} N would not be found. With --image both are trust.nii.gz."
    )
    return inlined(draw, "Three cuts with the score of a force at every place.", caption)
