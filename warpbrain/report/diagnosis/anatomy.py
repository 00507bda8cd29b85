"""Pictures of a body in a diagnosis: where the mismatch is, what the data see, what is left at recorded points."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.physics.words import length, number
from warpbrain.report.diagnosis.description import STATES
from warpbrain.report.diagnosis.figures import COLOURS
from warpbrain.report.diagnosis.files import Recorded, file_of_map
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.generative.page import BLACK, GREEN
from warpbrain.report.page.figures import TEXT, inlined, panels, shades
from warpbrain.report.page.scene import Arrows, Field, View
from warpbrain.report.slices import Cut, cut, level_line
from warpbrain.report.views import VIEWS, bare, draw_outline, in_view, scale_length
from warpbrain.report.views import View as Slice

#: Ground of the tissue, of what is significant, and lines of the hatching; length of the arrow of a large residual, as
#: a part of the size of the body; how arrows look.
_TISSUE, _TINT, _HATCHING, _LONG = "#f1eeea", "#cfe6dc", "#9a938b", 0.16
_ARROW = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.009, "headwidth": 3.6, "headlength": 4.2,
          "headaxislength": 3.8}  # fmt: skip


class Anatomy:
    """The body of a diagnosis with what its map says.

    Parameters
    ----------
    diagnosis : Diagnosis
    summary : dict
        Its `diagnosis.json`.
    """

    def __init__(self, diagnosis: Diagnosis, summary: dict[str, Any]) -> None:
        self.mesh, self.summary = diagnosis.base.at.system.model.mesh, summary
        self.fields = file_of_map(diagnosis).point_data
        self.threshold = summary["map"]["threshold"]

    @cached_property
    def ball(self) -> tuple[Floats, float] | None:
        """Centre (3,) and radius of what was located [m]."""
        where = self.summary["where"]
        return None if where is None else (np.array(where["centre_m"]), float(where["radius_m"]))

    @cached_property
    def centre(self) -> Floats:
        """Where to cut (3,) [m]: through what was located, else through the middle of the body."""
        if self.ball is not None:
            return self.ball[0]
        points = self.mesh.points
        # beside the midline, where a hemisphere is; elsewhere off planes that nodes of a regular mesh lie in
        off = np.array([0.12, 0.003, 0.003]) * np.ptp(points, axis=0)
        return 0.5 * (points.min(axis=0) + points.max(axis=0)) + off

    def plane(self, view: Slice) -> str:
        """A cut in words."""
        return f"{view.name}, {'xyz'[view.axis]} = {MILLIMETRES * self.centre[view.axis]:z.0f} mm"

    def draw(self, axes: Any, view: Slice) -> Cut:
        """Draw a cut: tissue, hatched where the data are blind, a line around what is significant."""
        from matplotlib.collections import LineCollection

        mesh, place = self.mesh, float(self.centre[view.axis])
        section = cut(mesh.points, mesh.tetrahedra, self.fields["score"], view.axis, place)
        everywhere = np.ones(len(section.polygons), dtype=bool)
        blind = self.fields["blind"][mesh.tetrahedra[section.elements]].mean(axis=1) > 0.5
        for part, style in (
            (everywhere, {"facecolor": _TISSUE, "edgecolor": _TISSUE, "linewidth": 0.3}),
            (section.values > self.threshold, {"facecolor": _TINT, "edgecolor": _TINT, "linewidth": 0.3}),
            (blind, {"facecolor": "none", "edgecolor": _HATCHING, "hatch": "//////", "linewidth": 0.0, "zorder": 2.0}),
        ):
            _fill(axes, section, part, style)
        segments = in_view(level_line(section, self.threshold))
        axes.add_collection(LineCollection(list(segments), colors=GREEN, linewidths=2.2))
        draw_outline(axes, mesh.boundary, mesh.points, view, place)
        return section

    def frame(self, axes: Any, view: Slice) -> None:
        """Limits around the body, letters of the directions at the edges and a scale bar below."""
        points, bar = self.mesh.points, scale_length(self.mesh)
        corners = in_view(np.array([points.min(axis=0)[view.plane], points.max(axis=0)[view.plane]]))
        low, high = corners.min(axis=0) - 0.6 * bar, corners.max(axis=0) + 0.6 * bar
        low[1] -= 0.5 * bar
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        bare(axes)
        middle = 0.5 * (corners[0] + corners[1])
        places = [(low[0] + 0.25 * bar, middle[1]), (high[0] - 0.25 * bar, middle[1]), (middle[0], low[1] + 0.75 * bar)]
        for letter, at in zip(view.letters, [*places, (middle[0], high[1] - 0.25 * bar)], strict=True):
            axes.text(*at, letter, fontsize=10, color="#555555", va="center", ha="center")
        axes.plot([low[0], low[0] + bar], [low[1] + 0.15 * bar] * 2, color="#333333", linewidth=2.0)
        axes.text(low[0] + 1.1 * bar, low[1] + 0.15 * bar, f"{bar:g} mm", fontsize=8, va="center", color="#333333")


def _fill(axes: Any, section: Cut, part: Bools, style: dict[str, Any]) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    if part.any():
        chosen = [Path(in_view(p), closed=False) for p, here in zip(section.polygons, part, strict=True) if here]
        axes.add_artist(PathPatch(Path.make_compound_path(*chosen), **style))


def map_figure(anatomy: Anatomy) -> str:
    """Scores as colours, with the threshold of significance as a line and the located ball as a dashed circle."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Circle

    threshold, where = anatomy.threshold, anatomy.summary["map"]
    extent = np.ptp(anatomy.mesh.points, axis=0)
    tallest = max(float(extent[view.plane[1]] / extent[view.plane[0]]) for view in VIEWS)

    def draw(narrow: bool) -> Any:
        figure, axes = panels(narrow, 1.3 + 2.7 * tallest, 3)
        tint: Any = None
        for panel, view in zip(axes, VIEWS, strict=True):
            section = anatomy.draw(panel, view)
            tint = PolyCollection(
                [in_view(p) for p in section.polygons], array=section.values, cmap=shades(), linewidths=0.2,
                edgecolors="face", zorder=1.0,
            )  # fmt: skip
            tint.set_clim(0.0, max(float(anatomy.fields["score"].max()), threshold))
            panel.add_collection(tint)
            if anatomy.ball is not None:
                at, radius = in_view(anatomy.centre[view.plane]), MILLIMETRES * anatomy.ball[1]
                style = {"facecolor": "none", "edgecolor": BLACK, "linestyle": "--", "linewidth": 1.3}
                panel.add_patch(Circle((float(at[0]), float(at[1])), radius, **style))
            panel.set_title(anatomy.plane(view), fontsize=TEXT)
            anatomy.frame(panel, view)
        shape = {"shrink": 0.9, "pad": 0.01} if narrow else {"shrink": 0.5, "pad": 0.02}
        bar = figure.colorbar(tint, ax=axes, orientation="horizontal", aspect=40, **shape)
        bar.set_label("score of a force there\n(chi-squared of 3 degrees of freedom)", fontsize=TEXT - 1)
        bar.ax.tick_params(labelsize=TEXT - 2)
        bar.ax.axvline(threshold, color=BLACK, linewidth=1.6)
        return figure

    caption = (
        f"How strongly a force at each place would explain the mismatch. The largest score, {where['largest']:.1f}, "
        f"{'is' if where['significant'] else 'is not'} above the threshold of {threshold:.1f} that pays for looking at "
        f"{where['places']} places (bar; green line). Dashed: the ball that was located. Hatched: a force of "
        f"{where['blind_above_n']:.2g} N would not be found. With --image both are trust.nii.gz."
    )
    return inlined(draw, "Three cuts with the score of a force at every place.", caption)


def residuals_figure(anatomy: Anatomy, recorded: Recorded) -> str:
    """What is left at every recorded point, one panel a state, on a common scale, over a cut of the anatomy."""
    vectors = recorded.vectors
    counted, shown, points = ~vectors.aside, list(vectors.left), anatomy.mesh.points
    first = vectors.left[shown[0]][counted]
    # the cut in whose plane most of the mismatch lies
    view = max(VIEWS, key=lambda one: float(np.sum(first[:, one.plane] ** 2)))
    large = float(np.quantile(np.linalg.norm(first, axis=1), 0.95)) or 1e-3
    enlarged = _LONG * float(np.ptp(points, axis=0).max()) / large
    across, high = np.ptp(points[:, view.plane], axis=0)
    errors = {state: length(anatomy.summary["fit"]["rmse_m"][state]) for state in shown}

    def draw(narrow: bool) -> Any:
        figure, axes = panels(narrow, 0.9 + 2.8 * float(high / across), len(shown), width=3.0 * len(shown))
        start = in_view(vectors.where[:, view.plane])
        for panel, state in zip(axes, shown, strict=True):
            anatomy.draw(panel, view)
            along = in_view(vectors.left[state][:, view.plane]) * enlarged
            panel.quiver(*start[counted].T, *along[counted].T, color=COLOURS[state], zorder=5, **_ARROW)
            panel.plot(*start[counted].T, ".", color=BLACK, markersize=2.0, zorder=6)
            panel.plot(*start[vectors.aside].T, "x", color=BLACK, markersize=6.0, zorder=6)
            panel.set_title(f"{STATES[state]}\nRMSE {errors[state]}", fontsize=TEXT + 1)
            anatomy.frame(panel, view)
        _key(axes[-1], _round(MILLIMETRES * large), enlarged, scale_length(anatomy.mesh))
        return figure

    times = np.unique(recorded["time_s"][recorded.lengths])
    when = f", at the last of {len(times)} times, {times[-1]:.3g} s" if len(times) > 1 else ""
    hidden = f" {int(vectors.aside.sum())} set aside: cross." if vectors.aside.any() else ""
    caption = (
        f"What is left at each of {len(vectors.where)} recorded points: arrows from the computed to the observed "
        f"place, {number(enlarged, 2)} times as long as they are, on a common scale, all points seen in the plane of a "
        f"cut ({anatomy.plane(view)}){when}.{hidden} Green: where a force is significant. Hatched: the data cannot see "
        "a force there."
    )
    listed = ", ".join(f"{STATES[state]} {error}" for state, error in errors.items())
    return inlined(draw, f"Arrows of what is left at recorded points; RMSE {listed}.", caption)


def _key(axes: Any, key: float, enlarged: float, bar: float) -> None:
    """An arrow of a round length [mm] at the lower right."""
    right, low = axes.get_xlim()[1] - 0.1 * bar, axes.get_ylim()[0] + 0.15 * bar
    left = right - key * enlarged
    axes.quiver([left], [low], [right - left], [0.0], color=BLACK, **_ARROW)
    axes.text(left - 0.1 * bar, low, f"{key:g} mm left", fontsize=8, ha="right", va="center", color="#333333")


def _round(value: float) -> float:
    """1, 2 or 5 and zeros, no more than a value."""
    decade = 10.0 ** math.floor(math.log10(value))
    return max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= value)


def view_of(anatomy: Anatomy, recorded: Recorded | None) -> View:
    """What the 3-D view shows: where something is, what the data see, what is left at recorded points."""
    points, arrows = np.zeros((0, 3)), []
    if recorded is not None:
        vectors = recorded.vectors
        points = vectors.where[~vectors.aside]
        # before and after: what lies between them is a click away
        ends = ("declared", list(vectors.left)[-1])
        arrows = [
            Arrows(STATES[state], COLOURS[state], left[~vectors.aside], state in ends)
            for state, left in vectors.left.items()
        ]
    score, force = anatomy.fields["score"], anatomy.fields["detectable_force"]
    moved = np.linalg.norm(anatomy.fields["displacement"], axis=1)
    threshold, blind = anatomy.threshold, MILLIMETRES * anatomy.summary["map"]["blind_above_n"]
    # only the surface is coloured
    on_it = np.unique(anatomy.mesh.boundary)
    # a few hidden places need a force beyond all others: they are as dark as what is blind twice over
    fields = [
        Field("significance", "score of a force there [1]", score, 0.0, max(float(score[on_it].max()), threshold),
              threshold, f"significant above {threshold:.1f}"),
        Field("detectable force", "smallest force that is found there [mN]", force, 0.0, 2.0 * blind, blind,
              f"the data cannot see above {blind:.0f} mN"),
        Field("displacement", "displacement of the base state [mm]", moved, 0.0, float(moved[on_it].max()) or 1.0, None,
              "the case with its tissue refitted, nothing else added"),
    ]  # fmt: skip
    return View(anatomy.mesh, fields, points, arrows, anatomy.ball)
