"""The picture of a case: its anatomy cut open, tissues, node sets and what was recorded, before any of it is computed.

Three cuts as a radiologist holds them, and the body from outside with a corner cut out, as PyVista renders it.
"""

import textwrap
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.mesh import face_vectors
from warpbrain.mesh.surface import EDGES
from warpbrain.recordings.recording import PointsRecording, Recording, SurfaceRecording
from warpbrain.report import views
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.picture import Moved, cameras_of, notes_on, scene_of, show
from warpbrain.report.rendering import BEFORE, RenderingError, render
from warpbrain.report.slices import cut
from warpbrain.report.summary import SET_TITLES
from warpbrain.report.views import View

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
_SPECIMEN_ENDS = ("+x", "+y", "+z", "-x", "-y", "-z")
_SIZE = (960, 840)  # pixels of the body from outside
_RIM = {"markeredgecolor": "#333333", "markeredgewidth": 0.4}
_SEAM = 0.8  # width of the rims of polygons of one colour, below which their seams show
_CHARACTERS = 105  # of a line above the panels
_LABEL = 30  # characters of a name in the legend
_LISTED = 12  # tissues, and recordings, in the legend


class _Scene:
    """A case as all panels draw it."""

    def __init__(self, case: Case) -> None:
        mesh, resection = case.mesh, case.resection
        self.case, self.mesh = case, mesh
        self.resected = views.resected_elements(mesh, *([] if resection is None else [resection.elements]))
        #: Of the tissues, by label.
        self.names = {label: tissue.name for label, tissue in case.tissues.items()}
        self.colours = views.element_colours(mesh, self.resected, self.names)
        #: Sides of the box around the body [m].
        self.box = np.ptp(mesh.points, axis=0)
        extent = float(self.box.max())
        ends = mesh.points[mesh.tetrahedra[:, EDGES]]
        edge = float(np.median(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=-1)))
        #: How far from a cut a node is still shown in it [m]: about half an element; of a flat body, not from one side
        #: to the other. And the same of what was recorded: farther, as it is sparser and is not on the outline.
        self.near = min(max(0.02 * extent, 0.4 * edge), 0.4 * float(self.box.min()))
        self.near_recorded = 2.0 * self.near
        #: The node sets that are drawn, the largest first, so that the small ones lie on top; beyond what can be told
        #: apart, the smaller ones say more.
        self.node_sets = sorted(mesh.node_sets.items(), key=lambda item: -int(item[1].sum()))[-len(_SET_STYLES) :]
        self.tracked = [r for r in case.recordings if isinstance(r, PointsRecording)]
        self.surfaces = [r for r in case.recordings if isinstance(r, SurfaceRecording)]
        #: How many arrows there are, and their factor: 1 if the longer ones can be seen at their true length.
        self.arrows = sum(recording.count for recording in self.tracked)
        self.enlarged = 1.0
        sizes = np.concatenate([np.zeros(0), *(np.linalg.norm(r.displacement, axis=1) for r in self.tracked)])
        longest, wanted = float(np.percentile(sizes, 95)) if len(sizes) else 0.0, 0.04 * extent
        if 0.0 < longest < wanted:
            decade = 10.0 ** np.floor(np.log10(wanted / longest))
            steps = (step * decade for step in (1.0, 2.0, 5.0, 10.0, 20.0))
            self.enlarged = float(next(factor for factor in steps if factor * longest >= wanted))


def write_case_picture(path: Path, case: Case) -> str:
    """Draw a case as PNG; returns why the body from outside is not in it, empty if it is."""
    scene = _Scene(case)
    figure, panels = views.panels(2, 2, (15.0, 11.6))
    cuts = views.VIEWS if case.specimen is None else _SPECIMEN_VIEWS
    for axes, view, place in zip(panels[:3], cuts, views.places(case.mesh, scene.resected), strict=True):
        _draw_cut(axes, scene, view, place)
    missing = _draw_open(panels[3], scene)
    _draw_legend(figure, scene)
    # on the left, for the legend is in the other corner
    views.save(figure, path, _headline(case), x=0.01, ha="left")
    return missing


def _headline(case: Case) -> str:
    """Title, origin and size, recordings: three lines, of which the user's may become two."""
    mesh = case.mesh
    origin = "stand-in, not the patient's images" if case.origin == "stand-in" else case.origin
    size = f"{len(mesh.points)} nodes, {len(mesh.tetrahedra)} tetrahedra, {1e6 * mesh.volume:.4g} cm3"
    recorded = ", ".join(f"{r.name} ({r.kind}, {r.count})" for r in case.recordings) or "nothing"
    title, recordings = (
        textwrap.fill(text, _CHARACTERS, max_lines=2, placeholder=" ...")
        for text in (case.title, f"recorded: {recorded}")
    )
    return "\n".join((title, f"{origin}; {size}", recordings))


def _draw_cut(axes: Any, scene: _Scene, view: View, place: float) -> None:
    mesh = scene.mesh
    section = cut(mesh.points, mesh.tetrahedra, np.zeros(len(mesh.points)), view.axis, place)
    views.draw_polygons(axes, section, _SEAM, facecolors=scene.colours[section.elements].tolist())
    views.draw_outline(axes, mesh, view, place)
    near = np.abs(mesh.points[:, view.axis] - place) <= scene.near
    for number, (_, members) in enumerate(scene.node_sets):
        at, (colour, shape) = views.in_view(mesh.points[members & near][:, view.plane]), _SET_STYLES[number]
        axes.plot(*at.T, shape, markersize=_dot_size(number), color=colour, **_RIM)
    for number, surface in enumerate(scene.surfaces):
        close = np.abs(surface.points[:, view.axis] - place) <= scene.near_recorded
        _crosses(axes, views.in_view(surface.points[close][:, view.plane]), number)
    shown = 0
    for number, tracked in enumerate(scene.tracked):
        close = np.abs(tracked.points[:, view.axis] - place) <= scene.near_recorded
        start, along = (x[close][:, view.plane] for x in (tracked.points, scene.enlarged * tracked.displacement))
        _arrows(axes, views.in_view(start), views.in_view(along), number)
        shown += int(close.sum())
    # room for letters and a scale bar beside a body with corners
    views.frame(axes, mesh, view, 0.085 * MILLIMETRES * float(scene.box.max()))
    counted = f"   ({shown} of {scene.arrows} arrows)" if scene.arrows else ""
    axes.set_title(views.heading(mesh, view, place) + counted, fontsize=11)


def _dot_size(number: int) -> float:
    """Smaller the later, so that a node of two sets shows both."""
    return 6.2 - 0.4 * number


def _crosses(axes: Any, at: Floats, number: int) -> None:
    axes.plot(*at.T, "x", markersize=4.0, markeredgewidth=0.9, color=_CROSSES[number % len(_CROSSES)])


def _arrows(axes: Any, start: Floats, along: Floats, number: int) -> None:
    """Arrows in picture coordinates, dark within a light rim to stand out from tissue and dots."""
    from matplotlib.patheffects import withStroke

    axes.quiver(
        *start.T, *along.T, angles="xy", scale_units="xy", scale=1.0, units="inches", width=0.022, headwidth=3.6,
        headlength=4.0, headaxislength=3.6, color=_ARROWS[number % len(_ARROWS)], zorder=5,
        path_effects=[withStroke(linewidth=1.3, foreground="white")],
    )  # fmt: skip


def _draw_open(axes: Any, scene: _Scene) -> str:
    """The body with a corner cut out and all that was recorded; why it is not rendered, or nothing."""
    from scipy.spatial import KDTree

    arrows = f"; all {scene.arrows} arrows, seen through the tissue" if scene.arrows else ""
    axes.set_title(f"a corner cut out{arrows}", fontsize=11)
    # the anatomy, and what is taken out of it in red, seen from where there is most to see
    recorded: list[PointsRecording | SurfaceRecording] = [*scene.tracked, *scene.surfaces]
    where = np.concatenate([np.zeros((0, 3)), *(recording.points for recording in recorded)])
    still = Moved(where, *np.zeros((2, *where.shape)))
    drawn = scene_of(scene.mesh, scene.resected, np.zeros_like(scene.mesh.points), scene.names, still)
    camera = cameras_of(drawn)[BEFORE]
    try:
        image = render(drawn, {BEFORE: camera}, _SIZE)[BEFORE]
    except RenderingError as error:
        views.bare(axes)
        axes.text(0.5, 0.5, textwrap.fill(str(error), 50), ha="center", va="center", transform=axes.transAxes)
        return str(error)
    ends = {} if scene.case.specimen is None else {"ends": _SPECIMEN_ENDS}
    show(axes, image, notes_on(camera, image.shape, scene.mesh, **ends))

    def at(points: Floats) -> Floats:
        """Where in the panel, in mm from its middle, positions (n, 3) [m] are."""
        return (MILLIMETRES * points - camera.centre) @ np.column_stack([camera.right, camera.up])

    corners = scene.mesh.points[scene.mesh.boundary]
    this_side = face_vectors(scene.mesh.points, scene.mesh.boundary) @ camera.towards > 0.0
    for number, surface in enumerate(scene.surfaces):
        # what is on the far side of the body is hidden
        _crosses(axes, at(surface.points[this_side[KDTree(corners.mean(axis=1)).query(surface.points)[1]]]), number)
    for number, tracked in enumerate(scene.tracked):
        start, end = at(tracked.points), at(tracked.points + scene.enlarged * tracked.displacement)
        _arrows(axes, start, end - start, number)
    return ""


def _draw_legend(figure: Any, scene: _Scene) -> None:
    near, near_recorded = (
        np.format_float_positional(MILLIMETRES * length, precision=2, fractional=False, trim="-") + " mm"
        for length in (scene.near, scene.near_recorded)
    )
    names = {label: _short(name) for label, name in scene.names.items()}
    sets = []
    for number, (name, members) in enumerate(scene.node_sets):
        colour, shape = _SET_STYLES[number]
        dot = _mark(marker=shape, markersize=_dot_size(number), color=colour, markeredgecolor="#333333")
        sets.append((dot, f"{_short(SET_TITLES.get(name, name))}: {members.sum()}"))
    if left_out := len(scene.mesh.node_sets) - len(sets):
        sets.append((_mark(), f"and {left_out} larger, not drawn"))
    arrow = {"marker": ">", "linestyle": "-", "linewidth": 1.8, "markersize": 6.0}
    cross = {"marker": "x", "markersize": 5.0}
    styles: list[tuple[Recording, dict[str, Any], str]]
    styles = [(r, arrow, colour) for r, colour in zip(scene.tracked, cycle(_ARROWS), strict=False)]
    styles += [(r, cross, colour) for r, colour in zip(scene.surfaces, cycle(_CROSSES), strict=False)]
    recorded = _first([(_mark(color=colour, **style), f"{_short(r.name)}: {r.count}") for r, style, colour in styles])
    if scene.tracked:
        length = "true length" if scene.enlarged == 1.0 else f"drawn {scene.enlarged:g} times as long"
        recorded.append((_mark(), f"arrows: {length}"))
    groups = {
        "tissue": _first(views.tissue_entries(names, scene.mesh, scene.resected)),
        f"nodes within {near} of a cut": sets,
        f"recorded (in a cut: within {near_recorded})": recorded,
    }
    entries: list[tuple[Any, str]] = []
    headings = []
    for title, group in groups.items():
        if group:
            headings.append(len(entries))
            entries += [(_mark(), title), *group, (_mark(), "")]
    texts = views.legend(figure, entries[:-1], loc="outside right upper", fontsize=10)
    for number in headings:
        texts[number].set_fontweight("bold")


def _first(entries: list[tuple[Any, str]]) -> list[tuple[Any, str]]:
    """As many as there is room for."""
    left_out = len(entries) - _LISTED
    return entries if left_out <= 0 else [*entries[:_LISTED], (_mark(), f"and {left_out} more")]


def _mark(**style: Any) -> Any:
    return views.line(**{"linestyle": "none", **style})


def _short(name: str) -> str:
    return textwrap.shorten(name, _LABEL, placeholder="...") if len(name) > _LABEL else name
