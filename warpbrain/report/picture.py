"""The picture of a run: the anatomy before, and the same cuts after, coloured by how far the tissue moved.

Drawn with matplotlib alone: a cut needs no renderer, so the picture comes out the same on a laptop, a server without a
display and a machine without graphics libraries. Cuts are shown as a radiologist holds them: the patient's left is on
the right of the picture.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.atomic import whole_file
from warpbrain.mesh import TetMesh, boundary_faces
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.slices import cut, outline
from warpbrain.simulation.result import Result

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_TISSUE_COLOURS = ("#b9aea6", "#efe8df", "#d3b8a8", "#c9d3c0", "#c5c3d8", "#d9cfa8")
_RESECTED = "#d9483b"


@dataclass(frozen=True)
class _View:
    """A cut: its name, the axis it is normal to, and the letters at its edges."""

    name: str
    axis: int
    letters: tuple[str, str, str, str]  # left, right, bottom, top of the picture


_VIEWS = (
    _View("axial", 2, ("R", "L", "P", "A")),
    _View("coronal", 1, ("R", "L", "I", "S")),
    _View("sagittal", 0, ("A", "P", "I", "S")),
)


def write_picture(path: Path, result: Result, whole: TetMesh, names: dict[int, str], title: str, subtitle: str) -> None:
    """Draw a result.

    Parameters
    ----------
    path : Path
        PNG file.
    result : Result
    whole : TetMesh
        The anatomy before anything was resected.
    names : dict
        Names of the tissues by label.
    title, subtitle : str
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    sizes = np.linalg.norm(result.u, axis=1) * MILLIMETRES
    top = max(float(np.percentile(sizes, 99.5)), 1e-3)
    figure, axes = plt.subplots(2, 3, figsize=(13.5, 9.4), constrained_layout=True)
    places = _places(whole)
    before, after = boundary_faces(whole.tetrahedra), boundary_faces(result.mesh.tetrahedra)
    for column, (view, place) in enumerate(zip(_VIEWS, places, strict=True)):
        _draw_before(axes[0, column], whole, before, view, place)
        shown = _draw_after(axes[1, column], result, after, sizes, view, place, top)
        for row in (0, 1):
            _frame(axes[row, column], whole, view)
        coordinate = "xyz"[view.axis]
        axes[0, column].set_title(f"{view.name}, {coordinate} = {place * MILLIMETRES:.0f} mm", fontsize=11)
    axes[0, 0].set_ylabel("before", fontsize=13)
    axes[1, 0].set_ylabel("after", fontsize=13)
    bar = figure.colorbar(shown, ax=axes[1, :], location="bottom", shrink=0.6, aspect=40, pad=0.02)
    bar.set_label("displacement [mm]   (dashed: where the surfaces were before)")
    _legend(figure, names, whole)
    # titles and names are the user's free text, in which a dollar sign begins no formula
    figure.suptitle(f"{title}\n{subtitle}", fontsize=13, parse_math=False)
    with whole_file(path) as temporary, warnings.catch_warnings():
        # a title in a script that the font lacks is no reason to print anything
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(temporary, dpi=110, format="png")
    plt.close(figure)


def _places(mesh: TetMesh) -> tuple[float, float, float]:
    """Where to cut [m]: through the resected tissue if there is any, and through a lateral ventricle."""
    ventricle = mesh.node_sets.get("ventricle", np.zeros(len(mesh.points), dtype=bool))
    centre = mesh.points[ventricle].mean(axis=0) if ventricle.any() else mesh.points.mean(axis=0)
    resected = mesh.element_sets.get("resection")
    if resected is not None and resected.any():
        cavity = mesh.points[mesh.tetrahedra[resected].ravel()].mean(axis=0)
        return float(cavity[2]), float(cavity[1]), float(cavity[0])
    # beside the midline, where a lateral ventricle is
    beside = float(np.quantile(mesh.points[ventricle, 0], 0.75)) if ventricle.any() else centre[0]
    return float(centre[2]), float(centre[1]), beside


def _in_view(coordinates: Floats) -> Floats:
    """Picture coordinates [mm] of in-plane coordinates [m]: the horizontal axis is turned, as radiologists hold it."""
    return np.array(coordinates) * (-MILLIMETRES, MILLIMETRES)


def _draw_before(axes: Any, mesh: TetMesh, faces: Ints, view: _View, place: float) -> None:
    from matplotlib.collections import PolyCollection

    section = cut(mesh.points, mesh.tetrahedra, np.zeros(len(mesh.points)), view.axis, place)
    labels = np.unique(mesh.tissue)
    colour = {int(label): _TISSUE_COLOURS[i % len(_TISSUE_COLOURS)] for i, label in enumerate(labels)}
    resected = mesh.element_sets.get("resection", np.zeros(len(mesh.tetrahedra), dtype=bool))
    colours = [_RESECTED if resected[e] else colour[int(mesh.tissue[e])] for e in section.elements]
    polygons = [_in_view(p) for p in section.polygons]
    axes.add_collection(PolyCollection(polygons, facecolors=colours, edgecolors=colours, linewidths=0.4))
    _draw_outline(axes, faces, mesh.points, view, place, "-", "#4d4640")


def _draw_after(axes: Any, result: Result, faces: Ints, sizes: Floats, view: _View, place: float, top: float) -> Any:
    from matplotlib.collections import PolyCollection

    mesh, moved = result.mesh, result.mesh.points + result.u
    section = cut(moved, mesh.tetrahedra, sizes, view.axis, place)
    polygons = [_in_view(p) for p in section.polygons]
    shown = PolyCollection(polygons, array=section.values, cmap="viridis", edgecolors="face", linewidths=0.4)
    shown.set_clim(0.0, top)
    axes.add_collection(shown)
    _draw_outline(axes, faces, moved, view, place, "-", "#1d1d1d")
    _draw_outline(axes, faces, mesh.points, view, place, (0, (3, 2)), "#c0392b")
    return shown


def _draw_outline(axes: Any, faces: Ints, points: Floats, view: _View, place: float, style: Any, colour: str) -> None:
    from matplotlib.collections import LineCollection

    segments = _in_view(outline(points, faces, view.axis, place))
    axes.add_collection(LineCollection(list(segments), colors=colour, linestyles=[style], linewidths=0.9))


def _frame(axes: Any, mesh: TetMesh, view: _View) -> None:
    plane = [k for k in range(3) if k != view.axis]
    corners = _in_view(np.array([mesh.points.min(axis=0)[plane], mesh.points.max(axis=0)[plane]]))
    low, high = corners.min(axis=0) - 8.0, corners.max(axis=0) + 8.0
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    for side in axes.spines.values():
        side.set_visible(False)
    left, right, bottom, top = view.letters
    style = {"fontsize": 11, "color": "#7a7a7a", "transform": axes.transAxes}
    axes.text(0.01, 0.5, left, va="center", ha="left", **style)
    axes.text(0.99, 0.5, right, va="center", ha="right", **style)
    axes.text(0.5, 0.0, bottom, va="bottom", ha="center", **style)
    axes.text(0.5, 1.0, top, va="top", ha="center", **style)
    # a scale bar of 20 mm
    axes.plot([low[0] + 4.0, low[0] + 24.0], [low[1] + 4.0, low[1] + 4.0], color="#333333", linewidth=2.0)
    axes.text(low[0] + 14.0, low[1] + 6.0, "20 mm", fontsize=8, ha="center", color="#333333")


def _legend(figure: Any, names: dict[int, str], mesh: TetMesh) -> None:
    from matplotlib.patches import Patch

    labels = np.unique(mesh.tissue).tolist()
    entries = [
        Patch(
            facecolor=_TISSUE_COLOURS[i % len(_TISSUE_COLOURS)], edgecolor="#4d4640", label=names.get(label, str(label))
        )
        for i, label in enumerate(labels)
    ]
    if mesh.element_sets.get("resection", np.zeros(1, dtype=bool)).any():
        entries.append(Patch(facecolor=_RESECTED, label="resected"))
    for text in figure.legend(handles=entries, loc="upper right", fontsize=9, frameon=False).get_texts():
        text.set_parse_math(False)
