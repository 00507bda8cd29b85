"""Figures of a diagnosis and its view: the body with what the map says, agreement, what imitates what, curves."""

import math
from functools import cached_property
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.diagnosis.result import Confusion, Diagnosis
from warpbrain.inference.calibration import percent
from warpbrain.physics.words import length, number, seconds
from warpbrain.report import views
from warpbrain.report.diagnosis.description import STATES
from warpbrain.report.diagnosis.files import Recorded, file_of_map
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.page.figures import NARROW, TEXT, WIDTH, colour_bar, inlined, panels, shades
from warpbrain.report.page.scene import Arrows, Field, describe_scene
from warpbrain.report.slices import Cut, cut
from warpbrain.report.views import BLACK, BLUE, GREEN, ORANGE, VERMILLION, VIEWS, in_view, round_below, scale_length
from warpbrain.worlds.specimen.protocol import Test
from warpbrain.worlds.specimen.result import SpecimenDiagnosis

#: Colours, markers and lines of the states of a case; in grey print the first is the darkest.
COLOURS = {"declared": VERMILLION, "refitted": ORANGE, "explained": BLUE}
_MARKERS = {"declared": "x", "refitted": "+", "explained": "o"}
_STYLES = {"declared": ":", "refitted": "--", "explained": "-"}
#: A part below the first is not written; above the second letters are white.
_SHOWN, _DARK = 0.01, 0.55
#: Ground of the tissue, of what is significant, and lines of the hatching; length of the arrow of a large residual, as
#: a part of the size of the body; how arrows look.
_TISSUE, _TINT, _HATCHING, _LONG = "#f1eeea", "#cfe6dc", "#9a938b", 0.16
_ARROW = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.009, "headwidth": 3.6, "headlength": 4.2,
          "headaxislength": 3.8}  # fmt: skip


class Anatomy:
    """The body of a diagnosis with what its map says; `summary` is its `diagnosis.json`."""

    def __init__(self, diagnosis: Diagnosis, summary: dict[str, Any]) -> None:
        self.mesh, self.summary, self._diagnosis = diagnosis.base.at.system.model.mesh, summary, diagnosis
        self.threshold, where, points = summary["map"]["threshold"], summary["where"], self.mesh.points
        #: Centre (3,) and radius of what was located [m], if anything was.
        self.ball = None if where is None else (np.array(where["centre_m"]), float(where["radius_m"]))
        # beside the midline, where a hemisphere is; elsewhere off planes that nodes of a regular mesh lie in
        off = np.array([0.12, 0.003, 0.003]) * np.ptp(points, axis=0)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0)) + off
        #: Where to cut (3,) [m]: through what was located, else through the middle of the body.
        self.centre: Floats = middle if self.ball is None else self.ball[0]
        #: Room around the body [mm] for letters, a scale bar and the key of arrows.
        self.margin = 0.7 * scale_length(self.mesh)

    @cached_property
    def fields(self) -> dict[str, Any]:
        """Those of the map at the nodes, by name."""
        return file_of_map(self._diagnosis).point_data

    def plane(self, view: views.View) -> str:
        """A cut in words."""
        return views.heading(self.mesh, view, float(self.centre[view.axis]))

    def draw(self, axes: Any, view: views.View) -> Cut:
        """Draw a cut: tissue, hatched where the data are blind, a line around what is significant."""
        mesh, place = self.mesh, float(self.centre[view.axis])
        section = cut(mesh.points, mesh.tetrahedra, self.fields["score"], view.axis, place)
        everywhere = np.ones(len(section.polygons), dtype=bool)
        for part, colour in ((everywhere, _TISSUE), (section.values > self.threshold, _TINT)):
            views.draw_part(axes, section, part, facecolor=colour, edgecolor=colour, linewidth=0.3)
        views.draw_hatching(axes, section, mesh, self.fields["blind"], "//////", _HATCHING)
        views.draw_level(axes, section, self.threshold, GREEN)
        views.draw_outline(axes, mesh, view, place)
        return section


def map_figure(anatomy: Anatomy) -> dict[str, Any]:
    """Scores as colours, with the threshold of significance as a line and the located ball as a dashed circle."""
    from matplotlib.patches import Circle

    threshold = anatomy.threshold
    extent = np.ptp(anatomy.mesh.points, axis=0)
    tallest = max(float(extent[view.plane[1]] / extent[view.plane[0]]) for view in VIEWS)

    def draw(narrow: bool) -> Any:
        figure, axes = panels(narrow, 1.3 + 2.7 * tallest, 3)
        tint: Any = None
        for panel, view in zip(axes, VIEWS, strict=True):
            section = anatomy.draw(panel, view)
            top = max(float(anatomy.fields["score"].max()), threshold)
            tint = views.draw_scalars(panel, section, top, 0.2, cmap=shades(), zorder=1.0)
            if anatomy.ball is not None:
                at, radius = in_view(anatomy.centre[view.plane]), MILLIMETRES * anatomy.ball[1]
                style = {"facecolor": "none", "edgecolor": BLACK, "linestyle": "--", "linewidth": 1.3}
                panel.add_patch(Circle((float(at[0]), float(at[1])), radius, **style))
            panel.set_title(anatomy.plane(view), fontsize=TEXT)
            views.frame(panel, anatomy.mesh, view, anatomy.margin)
        label = "score of a force there\n(chi-squared of 3 degrees of freedom)"
        bar = colour_bar(figure, tint, axes, narrow, label)
        bar.ax.axvline(threshold, color=BLACK, linewidth=1.6)
        return figure

    return inlined(draw)


def residuals_figure(anatomy: Anatomy, recorded: Recorded) -> dict[str, Any]:
    """What is left at every recorded point, one panel a state, on a common scale, over a cut of the anatomy."""
    vectors = recorded.vectors
    counted, shown, points = ~vectors.aside, list(vectors.left), anatomy.mesh.points
    first = vectors.left[shown[0]][counted]
    # the cut in whose plane most of the mismatch lies
    view = max(VIEWS, key=lambda cut_plane: float(np.sum(first[:, cut_plane.plane] ** 2)))
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
            views.frame(panel, anatomy.mesh, view, anatomy.margin)
        # an arrow of a round length at the lower right
        panel, key, bar = axes[-1], round_below(MILLIMETRES * large), scale_length(anatomy.mesh)
        right, low = panel.get_xlim()[1] - 0.1 * bar, panel.get_ylim()[0] + 0.15 * bar
        left = right - key * enlarged
        panel.quiver([left], [low], [right - left], [0.0], color=BLACK, **_ARROW)
        panel.text(left - 0.1 * bar, low, f"{key:g} mm left", fontsize=8, ha="right", va="center", color="#333333")
        return figure

    times = np.unique(recorded["time_s"][recorded.lengths])
    last = seconds(times[-1]) if len(times) > 1 else ""
    arrows = {"points": len(vectors.where), "enlarged": number(enlarged, 2), "plane": anatomy.plane(view)}
    aside = int(vectors.aside.sum())
    return inlined(draw, **arrows, times=len(times), last=last, aside=aside, errors=_listed(errors))


def _listed(errors: dict[str, str]) -> str:
    return ", ".join(f"{STATES[state]} {error}" for state, error in errors.items())


def view_of(anatomy: Anatomy, recorded: Recorded | None) -> dict[str, Any]:
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
    return describe_scene(anatomy.mesh, fields, points, arrows, anatomy.ball)


def agreement_figure(summary: dict[str, Any], recorded: Recorded) -> dict[str, Any]:
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

    return inlined(draw, errors=_listed(errors))


def confusion_figure(rows: dict[str, dict[str, float]]) -> dict[str, Any]:
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

    most = [f"{kind} by {imitator} {percent(part)}" for part, kind, imitator in Confusion(rows).largest]
    return inlined(draw, most=", ".join(most))


def curves_figure(diagnosis: SpecimenDiagnosis) -> dict[str, Any]:
    """Stress of tests, recorded and computed: one panel a test, over strain, or over time where the strain is held."""
    tests = diagnosis.protocol.tests

    def draw(narrow: bool) -> Any:
        columns = 1 if narrow else min(3, len(tests))
        lines = math.ceil(len(tests) / columns)
        figure, grid = views.panels(lines, columns, (NARROW if narrow else WIDTH, 0.5 + 2.3 * lines))
        for panel, test, rows in zip(grid, tests, diagnosis.protocol.rows, strict=False):
            known = (state for state in STATES if state in diagnosis.stresses)
            _curve(panel, test, {state: diagnosis.stresses[state][rows] for state in known})
        for empty in grid[len(tests) :]:
            empty.set_visible(False)
        grid[0].legend(fontsize=TEXT - 2, frameon=False)
        return figure

    return inlined(draw, tests=len(tests))


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
