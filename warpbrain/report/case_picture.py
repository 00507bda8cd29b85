"""The picture of a case: its anatomy cut open, tissues, node sets and what was recorded, before any of it is computed.

Three cuts as a radiologist holds them, and the body from outside with a corner cut out, as PyVista renders it.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats
from warpbrain.cases.case import Case
from warpbrain.mesh import TetMesh, boundary_faces, face_vectors
from warpbrain.recordings.recording import PointsRecording, SurfaceRecording, count_of
from warpbrain.report import views
from warpbrain.report.case_body import RenderedBody, render_body
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.rendering.offscreen import RenderingError
from warpbrain.report.slices import Cut, cut
from warpbrain.report.summary import SET_TITLES
from warpbrain.report.views import View

Ints = NDArray[np.int32]

#: Colour and shape of each node set, the largest set first; told apart by the colour-blind and without any colour.
_SET_STYLES = (
    ("#0072b2", "o"),
    ("#e69f00", "s"),
    ("#009e73", "^"),
    ("#cc79a7", "D"),
    ("#56b4e9", "v"),
    ("#f0e442", "P"),
    ("#332288", "X"),
    ("#999933", "p"),
)
_ARROWS = ("#000000", "#7a0177", "#00441b", "#5b3a00")
_CROSSES = ("#c2185b", "#01579b", "#33691e")
# a laboratory specimen has no left and no front
_SPECIMEN_VIEWS = (
    View("cut", 2, ("+x", "-x", "-y", "+y")),
    View("cut", 1, ("+x", "-x", "-z", "+z")),
    View("cut", 0, ("+y", "-y", "-z", "+z")),
)
_SEAM = 0.8  # width of the rims of polygons of one colour, below which their seams show
_CHARACTERS = 105  # of a line above the panels
_LABEL = 30  # characters of a name in the legend
_LISTED = 12  # tissues, and recordings, in the legend


@dataclass(frozen=True)
class _Scene:
    """A case as all panels draw it."""

    case: Case

    @property
    def mesh(self) -> TetMesh:
        return self.case.mesh

    @property
    def views(self) -> tuple[View, ...]:
        return views.VIEWS if self.case.specimen is None else _SPECIMEN_VIEWS

    @cached_property
    def resected(self) -> Bools:
        resection = self.case.resection
        return views.resected_elements(self.mesh, *([] if resection is None else [resection.elements]))

    @cached_property
    def places(self) -> tuple[float, float, float]:
        return views.places(self.mesh, self.resected)

    @cached_property
    def sections(self) -> tuple[Cut, ...]:
        """The cuts, in the order of `views`."""
        mesh, nothing = self.mesh, np.zeros(len(self.mesh.points))
        cuts = zip(self.views, self.places, strict=True)
        return tuple(cut(mesh.points, mesh.tetrahedra, nothing, view.axis, place) for view, place in cuts)

    @cached_property
    def names(self) -> dict[int, str]:
        """Of the tissues, by label."""
        return {label: tissue.name for label, tissue in self.case.tissues.items()}

    @cached_property
    def colours(self) -> NDArray[np.str_]:
        return views.element_colours(self.mesh, self.resected, self.names)

    @cached_property
    def boundary(self) -> Ints:
        return boundary_faces(self.mesh.tetrahedra)

    @cached_property
    def extent(self) -> float:
        """Largest side of the box around the body [m]."""
        return float(np.ptp(self.mesh.points, axis=0).max())

    @property
    def margin(self) -> float:
        """Room around the body [mm]: for letters and a scale bar beside a body with corners."""
        return 0.085 * MILLIMETRES * self.extent

    @cached_property
    def near(self) -> float:
        """How far from a cut a node is still shown in it [m]: about half an element."""
        edges = self.mesh.points[self.mesh.tetrahedra[:, [0, 0, 0, 1, 1, 2]]]
        edges = edges - self.mesh.points[self.mesh.tetrahedra[:, [1, 2, 3, 2, 3, 3]]]
        edge = float(np.median(np.linalg.norm(edges, axis=-1)))
        # of a flat body, not from one side to the other
        return min(max(0.02 * self.extent, 0.4 * edge), 0.4 * float(np.ptp(self.mesh.points, axis=0).min()))

    @property
    def near_recorded(self) -> float:
        """The same of what was recorded: farther, as it is sparser and is not on the outline."""
        return 2.0 * self.near

    @cached_property
    def node_sets(self) -> list[tuple[str, Bools]]:
        """The node sets that are drawn, the largest first, so that the small ones lie on top."""
        ordered = sorted(self.mesh.node_sets.items(), key=lambda item: -int(item[1].sum()))
        # beyond what can be told apart, the smaller ones say more
        return ordered[-len(_SET_STYLES) :]

    @cached_property
    def tracked(self) -> list[PointsRecording]:
        return [r for r in self.case.recordings if isinstance(r, PointsRecording)]

    @cached_property
    def surfaces(self) -> list[SurfaceRecording]:
        return [r for r in self.case.recordings if isinstance(r, SurfaceRecording)]

    @cached_property
    def enlarged(self) -> float:
        """Factor of the arrows: 1 if the longer ones can be seen at their true length."""
        sizes = [np.linalg.norm(r.displacement, axis=1) for r in self.tracked]
        longest = float(np.percentile(np.concatenate(sizes), 95)) if sizes and sum(map(len, sizes)) else 0.0
        wanted = 0.04 * self.extent
        if longest == 0.0 or longest >= wanted:
            return 1.0
        decade = 10.0 ** np.floor(np.log10(wanted / longest))
        return float(next(s * decade for s in (1.0, 2.0, 5.0, 10.0, 20.0) if s * decade * longest >= wanted))


def write_case_picture(path: Path, case: Case) -> str:
    """Draw a case.

    Parameters
    ----------
    path : Path
        PNG file.
    case : Case

    Returns
    -------
    str
        Why the body from outside is not in it; empty if it is.
    """
    from matplotlib.figure import Figure

    scene = _Scene(case)
    figure = Figure(figsize=(15.0, 11.6), layout="constrained")
    panels = figure.subplots(2, 2).ravel()
    for axes, view, place, section in zip(panels[:3], scene.views, scene.places, scene.sections, strict=True):
        _draw_cut(axes, scene, view, place, section)
    missing = _draw_open(panels[3], scene)
    _draw_legend(figure, scene)
    # on the left, for the legend is in the other corner
    figure.suptitle(_headline(case), x=0.01, ha="left", fontsize=12, parse_math=False)
    views.save(figure, path)
    return missing


def _headline(case: Case) -> str:
    """Title, origin and size, recordings: three lines, of which the user's may become two."""
    mesh = case.mesh
    origin = "stand-in, not the patient's images" if case.origin == "stand-in" else case.origin
    size = f"{len(mesh.points)} nodes, {len(mesh.tetrahedra)} tetrahedra, {1e6 * mesh.volume:.4g} cm3"
    recorded = ", ".join(f"{r.name} ({r.kind}, {count_of(r)})" for r in case.recordings) or "nothing"
    return "\n".join((_lines(case.title), f"{origin}; {size}", _lines(f"recorded: {recorded}")))


def _lines(text: str) -> str:
    """Free text as two lines at most."""
    return "\n".join(textwrap.wrap(text, _CHARACTERS, max_lines=2, placeholder=" ..."))


# the cuts ----------------------------------------------------------------------------------------------------------


def _draw_cut(axes: Any, scene: _Scene, view: View, place: float, section: Cut) -> None:
    views.draw_tissue(axes, section, scene.colours, _SEAM)
    views.draw_outline(axes, scene.boundary, scene.mesh.points, view, place)
    near = np.abs(scene.mesh.points[:, view.axis] - place) <= scene.near
    for number, (_, members) in enumerate(scene.node_sets):
        _dots(axes, views.in_view(scene.mesh.points[members & near][:, view.plane]), number)
    for number, surface in enumerate(scene.surfaces):
        close = np.abs(surface.points[:, view.axis] - place) <= scene.near_recorded
        _crosses(axes, views.in_view(surface.points[close][:, view.plane]), number)
    shown = 0
    for number, tracked in enumerate(scene.tracked):
        close = np.abs(tracked.points[:, view.axis] - place) <= scene.near_recorded
        start, along = (x[close][:, view.plane] for x in (tracked.points, scene.enlarged * tracked.displacement))
        _arrows(axes, views.in_view(start), views.in_view(along), number)
        shown += int(close.sum())
    views.frame(axes, scene.mesh, view, scene.margin)
    total = sum(map(count_of, scene.tracked))
    counted = f"   ({shown} of {total} arrows)" if total else ""
    axes.set_title(views.heading(scene.mesh, view, place) + counted, fontsize=11)


def _dots(axes: Any, at: Floats, number: int) -> None:
    """Members of a node set; smaller the later, so that a node of two sets shows both."""
    colour, shape = _SET_STYLES[number]
    axes.plot(*at.T, shape, markersize=_dot_size(number), color=colour, markeredgecolor="#333333", markeredgewidth=0.4)


def _dot_size(number: int) -> float:
    return 6.2 - 0.4 * number


def _crosses(axes: Any, at: Floats, number: int) -> None:
    axes.plot(*at.T, "x", markersize=4.0, markeredgewidth=0.9, color=_cross_colour(number))


def _arrows(axes: Any, start: Floats, along: Floats, number: int) -> None:
    """Arrows in picture coordinates, dark within a light rim to stand out from tissue and dots."""
    from matplotlib.patheffects import withStroke

    axes.quiver(
        *start.T,
        *along.T,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        units="inches",
        width=0.022,
        headwidth=3.6,
        headlength=4.0,
        headaxislength=3.6,
        color=_arrow_colour(number),
        path_effects=[withStroke(linewidth=1.3, foreground="white")],
        zorder=5,
    )


def _arrow_colour(number: int) -> str:
    return _ARROWS[number % len(_ARROWS)]


def _cross_colour(number: int) -> str:
    return _CROSSES[number % len(_CROSSES)]


# the body cut open -------------------------------------------------------------------------------------------------


def _draw_open(axes: Any, scene: _Scene) -> str:
    """The body with a corner cut out and all that was recorded; why it is not rendered, or nothing."""
    total = sum(map(count_of, scene.tracked))
    arrows = f"; all {total} arrows, seen through the tissue" if total else ""
    axes.set_title(f"a corner cut out{arrows}", fontsize=11)
    try:
        body = render_body(scene.case, scene.resected)
    except RenderingError as error:
        views.bare(axes)
        axes.text(0.5, 0.5, textwrap.fill(str(error), 50), ha="center", va="center", transform=axes.transAxes)
        return str(error)
    body.show(axes)
    for number, surface in enumerate(scene.surfaces):
        _crosses(axes, body.picture(surface.points[_on_this_side(surface.points, scene, body)]), number)
    for number, tracked in enumerate(scene.tracked):
        along = body.picture(tracked.points + scene.enlarged * tracked.displacement)
        start = body.picture(tracked.points)
        _arrows(axes, start, along - start, number)
    return ""


def _on_this_side(points: Floats, scene: _Scene, body: RenderedBody) -> Bools:
    """Which points of a surface are not on the far side of the body."""
    from scipy.spatial import KDTree

    corners = scene.mesh.points[scene.boundary]
    nearest = KDTree(corners.mean(axis=1)).query(points)[1]
    return np.asarray((face_vectors(scene.mesh.points, scene.boundary) @ body.camera.towards)[nearest] > 0.0)


# the legend --------------------------------------------------------------------------------------------------------


def _draw_legend(figure: Any, scene: _Scene) -> None:
    groups = (
        ("tissue", _tissues(scene)),
        (f"nodes within {_millimetres(scene.near)} of a cut", _sets(scene)),
        (f"recorded (in a cut: within {_millimetres(scene.near_recorded)})", _recordings(scene)),
    )
    entries: list[tuple[Any, str]] = []
    headings = []
    for title, group in groups:
        if group:
            headings.append(len(entries))
            entries += [(_line(), title), *group, (_line(), "")]
    texts = views.legend(figure, entries[:-1], loc="outside right upper", fontsize=10)
    for number in headings:
        texts[number].set_fontweight("bold")


def _tissues(scene: _Scene) -> list[tuple[Any, str]]:
    names = {label: _short(tissue.name) for label, tissue in scene.case.tissues.items()}
    return _first(views.tissue_entries(names, scene.mesh, scene.resected))


def _millimetres(length: float) -> str:
    return np.format_float_positional(MILLIMETRES * length, precision=2, fractional=False, trim="-") + " mm"


def _sets(scene: _Scene) -> list[tuple[Any, str]]:
    entries = []
    for number, (name, members) in enumerate(scene.node_sets):
        colour, shape = _SET_STYLES[number]
        dot = _line(marker=shape, markersize=_dot_size(number), color=colour, markeredgecolor="#333333")
        entries.append((dot, f"{_short(SET_TITLES.get(name, name))}: {members.sum()}"))
    left_out = len(scene.mesh.node_sets) - len(entries)
    return entries + ([(_line(), f"and {left_out} larger, not drawn")] if left_out else [])


def _recordings(scene: _Scene) -> list[tuple[Any, str]]:
    entries = []
    for number, tracked in enumerate(scene.tracked):
        arrow = _line(marker=">", linestyle="-", linewidth=1.8, markersize=6.0, color=_arrow_colour(number))
        entries.append((arrow, f"{_short(tracked.name)}: {count_of(tracked)}"))
    for number, surface in enumerate(scene.surfaces):
        cross = _line(marker="x", markersize=5.0, color=_cross_colour(number))
        entries.append((cross, f"{_short(surface.name)}: {count_of(surface)}"))
    length = "true length" if scene.enlarged == 1.0 else f"drawn {scene.enlarged:g} times as long"
    return _first(entries) + ([(_line(), f"arrows: {length}")] if scene.tracked else [])


def _first(entries: list[tuple[Any, str]]) -> list[tuple[Any, str]]:
    """As many as there is room for."""
    left_out = len(entries) - _LISTED
    return entries if left_out <= 0 else [*entries[:_LISTED], (_line(), f"and {left_out} more")]


def _line(**style: Any) -> Any:
    """A handle of the legend; nothing to be seen without a style."""
    from matplotlib.lines import Line2D

    return Line2D([], [], **{"linestyle": "none", **style})


def _short(name: str) -> str:
    return textwrap.shorten(name, _LABEL, placeholder="...") if len(name) > _LABEL else name
