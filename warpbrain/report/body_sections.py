"""What the pages of a run and of an estimate share: a body before and after, in pictures and in a view."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.mesh import TetMesh
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.generative.page import BLUE, VERMILLION
from warpbrain.report.page.document import Section, section, text
from warpbrain.report.page.scene import Arrows, Field, View
from warpbrain.report.page.viewer import viewer
from warpbrain.report.picture import Moved, Pictures, annotations_of, arrow_colours, heading, round_factor
from warpbrain.report.state_files import LEFT, SavedState
from warpbrain.report.views import RESECTED, tissue_colours

#: A large displacement is shown this long in a view, as a part of the size of the body.
_MOVED = 0.08


def before_and_after(pictures: Pictures | None, why_not: str) -> Section:
    """The rendered body; without pictures, why there are none."""
    if pictures is None:
        said = f'<p class="note">The body is not drawn here: {text(why_not)}. The view below needs a browser only.</p>'
        return section("Before and after", said)
    scene = pictures.scene
    panels = "".join(_panel(pictures, name) for name in pictures.images)
    stops = ", ".join(f"rgb({r} {g} {b})" for r, g, b in scene.table[[*range(0, 256, 32), 255]].tolist())
    bar = (
        f'<div class="bar"><div class="ends"><span>0</span><span>displacement [mm]</span><span>≥ {scene.top:.3g}</span>'
        f'</div><div class="scale" style="background:linear-gradient(to right, {stops})"></div></div>'
    )
    caption = (
        "The body before, and after with a corner cut out; three cuts, each plane drawn where it went. Red: where "
        "the body was before. Black arrows go from where tissue was to where it went."
    )
    if len(scene.where):
        caption += f" {len(scene.where)} points were recorded: how far they moved, and how far they move here."
    left = set(pictures.whole.tissue[~pictures.resected].tolist())
    colours = tissue_colours(pictures.names, pictures.whole)
    names = {colour: pictures.names.get(label, str(label)) for label, colour in colours.items() if label in left}
    if pictures.resected.any():
        names[RESECTED] = "resected"
    names |= {colour: name for name, colour in arrow_colours(scene).items()}
    legend = "".join(
        f'<li><span class="swatch" style="background:{colour}"></span> {text(name)}</li>'
        for colour, name in names.items()
    )
    return section(
        "Before and after",
        f'<figure><div class="panels">{panels}</div>{bar}<ul class="legend">{legend}</ul>'
        f"<figcaption>{text(caption)}</figcaption></figure>",
    )


def _panel(pictures: Pictures, name: str) -> str:
    """A picture with what is written on it, as a drawing that has any size."""
    notes, image = annotations_of(pictures, name), pictures.images[name]
    high, across = image.shape[:2]
    scale = across / (2.0 * notes.across)

    def at(x: float, y: float) -> tuple[float, float]:
        return scale * (x + notes.across), scale * (notes.high - y)

    marks = []
    for x, y, letter in notes.letters:
        column, row = at(x, y)
        marks.append(f'<text x="{column:.0f}" y="{row:.0f}" dominant-baseline="central">{letter}</text>')
    left, low, length, said = notes.bar
    for line in (*notes.lines, (left, low, left + length, low)):
        (x1, y1), (x2, y2) = at(*line[:2]), at(*line[2:])
        marks.append(f'<line x1="{x1:.0f}" y1="{y1:.0f}" x2="{x2:.0f}" y2="{y2:.0f}"/>')
    column, row = at(left + 0.5 * length, low)
    marks.append(f'<text x="{column:.0f}" y="{row - 10:.0f}">{text(said)}</text>')
    first, second = heading(pictures, name).split("\n")
    title = text(f"{first}, {second}" if second else first)
    return (
        f'<figure class="panel"><svg viewBox="0 0 {across} {high}" role="img" aria-label="{title}">'
        f'<image href="{_data(image)}" width="{across}" height="{high}"/>{"".join(marks)}</svg>'
        f"<figcaption><b>{text(first)}</b><br>{text(second)}</figcaption></figure>"
    )


def _data(image: Any) -> str:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(image).save(stream, format="JPEG", quality=90, subsampling=0)
    return f"data:image/jpeg;base64,{base64.b64encode(stream.getvalue()).decode()}"


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


def in_three_dimensions(
    mesh: TetMesh,
    u: Floats,
    fields: Sequence[Field],
    moved: Moved,
    places: Sequence[float],
    exaggeration: float | None = None,
) -> Section:
    """The view of a displaced body, with what was recorded and computed at points.

    Parameters
    ----------
    mesh : TetMesh
    u : (n, 3) array
        Displacement [m].
    fields : sequence of Field
        Beside the size of the displacement.
    moved : Moved
    places : sequence of float
        Of the axial, the coronal and the sagittal cut [m].
    exaggeration : float, optional
        How many times as large motion is shown at first; chosen so that it is seen.
    """
    sizes = np.linalg.norm(u, axis=1)
    large, size = float(np.percentile(sizes, 99.5)), float(np.ptp(mesh.points, axis=0).max())
    factor = round_factor(_MOVED * size, large) if exaggeration is None else exaggeration
    shown = [Field("displacement", "displacement [mm]", MILLIMETRES * sizes, 0.0, MILLIMETRES * large or 1.0), *fields]
    arrows = []
    if len(moved.where):
        arrows = [Arrows("recorded", VERMILLION, moved.recorded), Arrows("computed", BLUE, moved.computed)]
    cuts = dict(zip(("axial", "coronal", "sagittal"), zip((2, 1, 0), places, strict=True), strict=True))
    view = View(mesh, shown, moved.where, arrows, None, u, factor, cuts)
    note = "Motion as large as it is: 1 times; before: 0 times."
    return section("In three dimensions", viewer(view, "points", note))
