"""What pages of bodies share: pictures before and after, a view, how well the displacement is known; and `view`."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from warpbrain.arrays import Floats
from warpbrain.atomic import write_text
from warpbrain.mesh import TetMesh
from warpbrain.report import views
from warpbrain.report.files import LEFT, MILLIMETRES, TRUST, UNSEEN, SavedState
from warpbrain.report.page import page, part
from warpbrain.report.page.figures import TEXT, colour_bar, data, inlined, panels
from warpbrain.report.page.scene import Arrows, Field, describe_scene, viewer
from warpbrain.report.picture import Moved, Pictures, arrow_colours, heading, notes_on, round_factor, scene_of
from warpbrain.report.slices import cut
from warpbrain.report.views import BLUE, QUIET, VERMILLION

#: A large displacement is shown this long in a view, as a part of the size of the body.
_MOVED = 0.08
_NO_POINTS = Moved(*np.zeros((3, 0, 3)))


def before_and_after(pictures: Pictures | str) -> Markup:
    """The rendered body; without pictures, why there are none."""
    if isinstance(pictures, str):
        return part("no_pictures", pictures)
    scene = pictures.scene
    stops = ", ".join(f"rgb({r} {g} {b})" for r, g, b in scene.table[[*range(0, 256, 32), 255]].tolist())
    legend = [*views.tissue_legend(pictures.names, pictures.whole, pictures.resected), *arrow_colours(scene).items()]
    drawn = [_panel(pictures, name, image) for name, image in pictures.images.items()]
    return part("pictures", drawn, f"{scene.top:.3g}", stops, legend, len(scene.where))


def _panel(pictures: Pictures, name: str, image: Any) -> dict[str, Any]:
    """A picture with what is written on it, as a drawing that has any size."""
    from PIL import Image

    notes = notes_on(pictures.cameras[name], image.shape, pictures.whole)
    height, width = image.shape[:2]
    scale = width / (2.0 * notes.across)

    def at(x: float, y: float) -> tuple[str, str]:
        return f"{scale * (x + notes.across):.0f}", f"{scale * (notes.high - y):.0f}"

    left, low, length, words = notes.bar
    middle, base = scale * (left + 0.5 * length + notes.across), scale * (notes.high - low)
    lines = [(*at(x, y), *at(to_x, to_y)) for x, y, to_x, to_y in (*notes.lines, (left, low, left + length, low))]
    first, second = heading(pictures, name).split("\n")
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, format="JPEG", quality=90, subsampling=0)
    return {
        "image": data("jpeg", stream), "width": width, "height": height, "lines": lines,
        "letters": [(*at(x, y), letter) for x, y, letter in notes.letters],
        "bar": (f"{middle:.0f}", f"{base - 10:.0f}", words),
        "heading": (first, second), "title": f"{first}, {second}" if second else first,
    }  # fmt: skip


def fields_of(state: SavedState) -> list[Field]:
    """What is known of a displacement at each place, as far as the result knows it."""
    fields = []
    if state.deviation is not None:
        known = MILLIMETRES * state.deviation
        highest = float(known.max()) or 1.0
        fields.append(Field("standard deviation", "standard deviation of the displacement [mm]", known, 0.0, highest))
    if state.trust is not None:
        label = "1: recordings see it, 2: they do not, 3: something is left there"
        fields.append(Field("trust", label, state.trust.astype(np.float64), 1.0, float(LEFT)))
    return fields


def body_view(
    mesh: TetMesh,
    u: Floats,
    fields: Sequence[Field],
    moved: Moved,
    places: Sequence[float],
    exaggeration: float | None = None,
) -> Markup:
    """The view of a body displaced by u (n, 3) [m], with what was recorded and computed at points.

    `fields` stand beside the size of the displacement, `places` [m] are those of the axial, the coronal and the
    sagittal cut; how many times as large motion is shown at first is chosen so that it is seen, unless it is given.
    """
    sizes = np.linalg.norm(u, axis=1)
    large, size = float(np.percentile(sizes, 99.5)), float(np.ptp(mesh.points, axis=0).max())
    factor = round_factor(_MOVED * size, large) if exaggeration is None else exaggeration
    shown = [Field("displacement", "displacement [mm]", MILLIMETRES * sizes, 0.0, MILLIMETRES * large or 1.0), *fields]
    arrows = []
    if len(moved.where):
        arrows = [Arrows("recorded", VERMILLION, moved.recorded), Arrows("computed", BLUE, moved.computed)]
    cuts = [(view.name, view.axis, place) for view, place in zip(views.VIEWS, places, strict=True)]
    scene = describe_scene(mesh, shown, moved.where, arrows, None, u, factor, cuts)
    return viewer(scene, "points", "Motion as large as it is: 1 times; before: 0 times.")


def known_displacement(state: SavedState, whole: TetMesh, places: Sequence[float]) -> dict[str, Any] | None:
    """Where the displacement is known and how well, as the macro `known` of a page takes it; None where nothing is
    known of it.

    `whole` is the anatomy before anything was resected, `places` [m] as of `body_view`.
    """
    if state.deviation is None or not state.deviation.any():
        return None
    values, volumes = MILLIMETRES * state.deviation, state.mesh.node_volumes
    moves = MILLIMETRES * np.linalg.norm(state.u[values.argmax()])
    trust = None
    if state.trust is not None:
        trust = [(TRUST[k], 100.0 * volumes[state.trust == k].sum() / volumes.sum()) for k in (UNSEEN, LEFT)]

    def draw(narrow: bool) -> Any:
        figure, axes = panels(narrow, 3.4, 3)
        drawn: Any = None
        for panel, view, place in zip(axes, views.VIEWS, places, strict=True):
            drawn = views.draw_values(panel, state.mesh, values, view, place, float(values.max()))
            if state.trust is not None:
                # hatched: what recordings do not see; dots, and a line around them: where they and the case disagree
                left = (state.trust == LEFT).astype(np.float64)
                section = cut(state.mesh.points, state.mesh.tetrahedra, left, view.axis, place)
                for value, hatch, colour in ((UNSEEN, "//////", "white"), (LEFT, "....", VERMILLION)):
                    views.draw_hatching(panel, section, state.mesh, state.trust == value, hatch, colour)
                views.draw_level(panel, section, 0.5, VERMILLION, zorder=2.5)
            panel.set_title(views.heading(whole, view, place), fontsize=TEXT)
        colour_bar(figure, drawn, axes, narrow, "standard deviation of the displacement [mm]")
        return figure

    return inlined(draw, deviation=values.max(), moves=moves, trust=trust)


def window(state: SavedState, exaggeration: float | None) -> Any:
    """A plotter of PyVista that shows a body, before it is shown; `exaggeration` is chosen if it is None."""
    # a graphics library is asked for here only
    from warpbrain.report.rendering.drawing import interactive

    nothing = np.zeros(len(state.mesh.tetrahedra), dtype=bool)
    return interactive(scene_of(state.mesh, nothing, state.u, {}, _NO_POINTS), exaggeration)


def write_view_page(path: Path, state: SavedState, exaggeration: float | None) -> None:
    """Write a body as one HTML file; `exaggeration` is chosen if it is None."""
    view = body_view(state.mesh, state.u, fields_of(state), _NO_POINTS, views.places(state.mesh), exaggeration)
    largest = MILLIMETRES * float(np.linalg.norm(state.u, axis=1).max())
    text = page(
        f"warpbrain: {state.path.name}", str(state.path), "a deformed body", (QUIET, "#ffffff"), [],
        "view.html", view=view, largest=largest, nodes=len(state.mesh.points),
    )  # fmt: skip
    write_text(path, text)
