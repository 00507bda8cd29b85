"""What the pictures share: colours, figures and their files, where an anatomy is cut, how a cut is held and framed.

Drawn with matplotlib: a cut needs no renderer, so a picture comes out the same on a laptop, a server without a display
and a machine without graphics libraries. Cuts are shown as a radiologist holds them: the patient's left is on
the right of the picture.
"""

import math
import warnings
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats
from warpbrain.atomic import whole_file
from warpbrain.mesh import TetMesh
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.slices import Cut, cut, level_line, outline

#: Colours of Okabe and Ito, whom everybody can tell apart; and greys.
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"
BLACK, QUIET = "#000000", "#555555"
#: Of tissue in pictures: that of its name. A name that the presets of labels do not give has one of the remaining ones,
#: the same wherever it stands; labels without a name have them in the order of their numbers.
COLOUR_OF = {
    "brain": "#b9aea6",
    "grey matter": "#b9aea6",
    "white matter": "#efe8df",
    "brain stem": "#d3b8a8",
    "lesion": "#b5651d",
    "tumour core": "#7b4b94",
    "enhancing tumour": "#4b2a63",
    "oedema": "#8fb3c9",
}
TISSUE_COLOURS = ("#b9aea6", "#efe8df", "#d3b8a8", "#c9d3c0", "#c5c3d8", "#d9cfa8", "#bfd5d3", "#dcc3cb")
RESECTED = "#d9483b"
TISSUE_EDGE = "#4d4640"
_DPI = 110.0


def panels(
    rows: int, columns: int, size: tuple[float, float], layout: Any = "constrained", **options: Any
) -> tuple[Any, list[Any]]:
    """A figure of that size [inch] and its panels, row by row."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout=layout, facecolor="white")
    return figure, list(figure.subplots(rows, columns, squeeze=False, **options).ravel())


def entitle(figure: Any, title: str, fontsize: float = 12.0, **options: Any) -> None:
    """Write a title above a figure, which may be a user's free text."""
    # a dollar sign in it begins no formula
    figure.suptitle(title, parse_math=False, fontsize=fontsize, **options)


def lay_out(figure: Any) -> None:
    """Place all of a figure once and for all, before what its panels show is known, if it is as large."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure.set_dpi(_DPI)
    FigureCanvasAgg(figure)
    figure.get_layout_engine().execute(figure)
    figure.set_layout_engine("none")


def save(figure: Any, path: Path, title: str = "", fontsize: float = 12.0, dpi: float = _DPI, **options: Any) -> None:
    """Write a figure as PNG, whole, below a title if there is one."""
    if title:
        entitle(figure, title, fontsize, **options)
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        write_png(figure, stream, dpi)


def write_png(figure: Any, stream: BinaryIO, dpi: float) -> None:
    """Write a figure; a name in a script that the font lacks is no reason to print anything."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure.set_dpi(dpi)
    canvas: Any = FigureCanvasAgg(figure)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        # what `savefig` comes to after it has drawn all of it once to measure it, which the layout does by itself
        canvas.print_png(stream)


@dataclass(frozen=True)
class View:
    """A cut: its name, the axis it is normal to, and the letters at its edges."""

    name: str
    axis: int
    letters: tuple[str, str, str, str]  # left, right, bottom, top of the picture

    @property
    def plane(self) -> list[int]:
        """The two axes that are not cut."""
        return [k for k in range(3) if k != self.axis]


VIEWS = (
    View("axial", 2, ("R", "L", "P", "A")),
    View("coronal", 1, ("R", "L", "I", "S")),
    View("sagittal", 0, ("A", "P", "I", "S")),
)


def resected_elements(mesh: TetMesh, name: str = "resection") -> Bools:
    """Elements of the set that was taken out; none if there is no such set."""
    return mesh.element_sets.get(name, np.zeros(len(mesh.tetrahedra), dtype=bool))


def places(mesh: TetMesh, resected: Bools | None = None) -> tuple[float, float, float]:
    """Where to cut [m], in the order of `VIEWS`: through the resected tissue, else through a lateral ventricle."""
    resected = resected_elements(mesh) if resected is None else resected
    ventricle = mesh.node_sets.get("ventricle", np.zeros(len(mesh.points), dtype=bool))
    centre = mesh.points[ventricle].mean(axis=0) if ventricle.any() else mesh.points.mean(axis=0)
    if resected.any():
        cavity = mesh.points[mesh.tetrahedra[resected].ravel()].mean(axis=0)
        return float(cavity[2]), float(cavity[1]), float(cavity[0])
    # beside the midline, where a lateral ventricle is
    lateral = float(np.quantile(mesh.points[ventricle, 0], 0.75)) if ventricle.any() else float(centre[0])
    return float(centre[2]), float(centre[1]), lateral


def in_view(coordinates: Floats) -> Floats:
    """Picture coordinates [mm] of in-plane coordinates [m]: the horizontal axis is turned, as radiologists hold it."""
    return np.array(coordinates) * (-MILLIMETRES, MILLIMETRES)


def round_below(value: float) -> float:
    """1, 2 or 5 and zeros, no more than a value."""
    decade = 10.0 ** math.floor(math.log10(value))
    # a logarithm rounded up is why a half is among them
    return max(step * decade for step in (0.5, 1.0, 2.0, 5.0) if step * decade <= value)


def scale_length(mesh: TetMesh) -> float:
    """Length of the scale bar [mm]: 1, 2 or 5 and zeros, 20 for a brain."""
    return round_below(MILLIMETRES * float(np.ptp(mesh.points, axis=0).max()) / 6.0)


def heading(mesh: TetMesh, view: View, place: float) -> str:
    """Name of a cut and where it is."""
    # as fine as the scale bar makes sense of; -0 is 0
    decimals = max(0, 1 - math.floor(math.log10(scale_length(mesh))))
    return f"{view.name}, {'xyz'[view.axis]} = {place * MILLIMETRES:z.{decimals}f} mm"


def tissue_colours(names: Mapping[int, str], mesh: TetMesh) -> dict[int, str]:
    """Colour of each label of a mesh, whatever the order of the labels."""
    chosen = {label: COLOUR_OF[names[label]] for label in mesh.labels if names.get(label) in COLOUR_OF}
    spare = [colour for colour in TISSUE_COLOURS if colour not in COLOUR_OF.values()]
    # one that nobody named is called so (`cases new`)
    named = {label: name for label, name in names.items() if name != f"tissue {label}" and label not in chosen}
    for name, label in sorted((named[label], label) for label in mesh.labels if label in named):
        # that of the name in every case, unless another tissue of this one has it already
        first = zlib.crc32(name.encode()) % len(spare)
        wishes = [*spare[first:], *spare[:first]]
        chosen[label] = next((colour for colour in wishes if colour not in chosen.values()), wishes[0])
    left = [colour for colour in TISSUE_COLOURS if colour not in chosen.values()]
    nameless = [label for label in mesh.labels if label not in chosen]
    return chosen | {label: left[i % len(left)] for i, label in enumerate(nameless)}


def element_colours(mesh: TetMesh, resected: Bools, names: Mapping[int, str] | None = None) -> NDArray[np.str_]:
    """Colour of each element: of its tissue, or that of what was resected; see `tissue_colours`."""
    colours, numbers = tissue_colours(names or {}, mesh), np.unique(mesh.tissue, return_inverse=True)[1]
    return np.where(resected, RESECTED, np.array([colours[label] for label in mesh.labels])[numbers])


def draw_polygons(axes: Any, section: Cut, rim: float, **style: Any) -> Any:
    """Fill the polygons of a cut; a rim of the same colour hides the seams between them."""
    from matplotlib.collections import PolyCollection

    polygons = [in_view(polygon) for polygon in section.polygons]
    return axes.add_collection(PolyCollection(polygons, edgecolors="face", linewidths=rim, **style))


def draw_scalars(axes: Any, section: Cut, top: float, rim: float = 0.4, **style: Any) -> Any:
    """Colour a cut by what it carries, from 0 to `top`; returns what a colour bar is made of."""
    return draw_polygons(axes, section, rim, array=section.values, clim=(0.0, top), **style)


def draw_values(axes: Any, mesh: TetMesh, values: Floats, view: View, place: float, top: float) -> Any:
    """Draw a framed cut coloured by nodal values (n,), from 0 to `top`; returns what a colour bar is made of."""
    drawn = draw_scalars(axes, cut(mesh.points, mesh.tetrahedra, values, view.axis, place), top)
    draw_outline(axes, mesh, view, place)
    frame(axes, mesh, view)
    return drawn


def draw_level(axes: Any, section: Cut, level: float, colour: str, zorder: float = 2.0) -> None:
    """A line where the values that a cut carries are at a level."""
    from matplotlib.collections import LineCollection

    segments = in_view(level_line(section, level))
    axes.add_collection(LineCollection(list(segments), colors=colour, linewidths=2.2, zorder=zorder))


def draw_part(axes: Any, section: Cut, part: Bools, **style: Any) -> None:
    """Fill some polygons (k,) of a cut as one shape, so that a hatching goes on from one to the next."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Shape

    if part.any():
        chosen = (Shape(in_view(polygon)) for polygon, here in zip(section.polygons, part, strict=True) if here)
        axes.add_artist(PathPatch(Shape.make_compound_path(*chosen), **style))


def draw_hatching(axes: Any, section: Cut, mesh: TetMesh, nodes: Any, hatch: str, colour: str) -> None:
    """Hatch the elements of a cut of which most nodes are among those (n,) that are true."""
    inside = nodes[mesh.tetrahedra[section.elements]].mean(axis=1) > 0.5
    draw_part(axes, section, inside, facecolor="none", edgecolor=colour, hatch=hatch, linewidth=0.0, zorder=2.0)


def draw_outline(axes: Any, mesh: TetMesh, view: View, place: float, colour: str = TISSUE_EDGE) -> None:
    """Draw where the surface of a body crosses the plane of a cut."""
    from matplotlib.collections import LineCollection

    segments = in_view(outline(mesh.points, mesh.boundary, view.axis, place))
    axes.add_collection(LineCollection(list(segments), colors=colour, linewidths=0.9))


def frame(axes: Any, mesh: TetMesh, view: View, margin: float | None = None) -> None:
    """Frame a cut: limits at a margin [mm] around the body, letters and scale bar."""
    length = scale_length(mesh)
    margin = 0.4 * length if margin is None else margin
    corners = in_view(np.array([mesh.points.min(axis=0)[view.plane], mesh.points.max(axis=0)[view.plane]]))
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    bare(axes)
    left, right, bottom, top = view.letters
    for letter, x, y, ha, va in (
        *((left, 0.01, 0.5, "left", "center"), (right, 0.99, 0.5, "right", "center")),
        *((bottom, 0.5, 0.0, "center", "bottom"), (top, 0.5, 1.0, "center", "top")),
    ):
        axes.text(x, y, letter, ha=ha, va=va, fontsize=11, color="#7a7a7a", transform=axes.transAxes)
    start, height = low + 0.2 * length
    axes.plot([start, start + length], [height, height], color="#333333", linewidth=2.0)
    middle, above = start + 0.5 * length, height + 0.1 * length
    axes.text(middle, above, f"{length:g} mm", fontsize=8, ha="center", color="#333333")


def bare(axes: Any) -> None:
    """Equal scales, no ticks, no box."""
    axes.set_aspect("equal")
    # constrained layout measures what is not hidden, even if it is empty
    for part in (axes.xaxis, axes.yaxis, axes.spines[:]):
        part.set_visible(False)


def tissue_entries(names: Mapping[int, str], mesh: TetMesh, resected: Bools) -> list[tuple[Any, str]]:
    """Legend entries of the tissues that something is left of, and of what was resected."""
    return [
        (patch(facecolor=colour) if colour == RESECTED else patch(facecolor=colour, edgecolor=TISSUE_EDGE), name)
        for name, colour in tissue_legend(names, mesh, resected)
    ]


def tissue_legend(names: Mapping[int, str], mesh: TetMesh, resected: Bools) -> list[tuple[str, str]]:
    """Names and colours of the tissues that something is left of, and of what was resected."""
    left = set(np.unique(mesh.tissue[~resected]).tolist())
    colours = sorted(tissue_colours(names, mesh).items())
    entries = [(names.get(label, str(label)), colour) for label, colour in colours if label in left]
    return entries + ([("resected", RESECTED)] if resected.any() else [])


def line(**style: Any) -> Any:
    """A line or a mark of a legend; nothing to be seen without a style."""
    from matplotlib.lines import Line2D

    return Line2D([], [], **style)


def patch(**style: Any) -> Any:
    """A patch of a legend."""
    from matplotlib.patches import Patch

    return Patch(**style)


def legend(figure: Any, entries: Sequence[tuple[Any, str]], **options: Any) -> list[Any]:
    """A legend of the whole figure; the texts, in the order of the entries."""
    # labels are set afterwards: names are the user's free text, in which a dollar sign begins no formula and a leading
    # underscore hides nothing
    made = figure.legend([handle for handle, _ in entries], ["-"] * len(entries), frameon=False, **options)
    for text, (_, label) in zip(made.get_texts(), entries, strict=True):
        text.set_parse_math(False)
        text.set_text(label)
    return list(made.get_texts())
