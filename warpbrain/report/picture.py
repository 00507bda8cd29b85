"""The picture of a run: the anatomy before, and the same cuts after, coloured by how far the tissue moved."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.mesh import TetMesh, boundary_faces
from warpbrain.report import views
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.slices import cut
from warpbrain.report.views import View
from warpbrain.simulation.result import Result

Ints = NDArray[np.int32]


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
    resected = views.resected_elements(whole)
    before, after = boundary_faces(whole.tetrahedra), boundary_faces(result.mesh.tetrahedra)
    for column, (view, place) in enumerate(zip(views.VIEWS, views.places(whole, resected), strict=True)):
        section = cut(whole.points, whole.tetrahedra, np.zeros(len(whole.points)), view.axis, place)
        views.draw_tissue(axes[0, column], section, views.element_colours(whole, resected, names))
        views.draw_outline(axes[0, column], before, whole.points, view, place)
        shown = _draw_after(axes[1, column], result, after, sizes, view, place, top)
        for row in (0, 1):
            views.frame(axes[row, column], whole, view)
        axes[0, column].set_title(views.heading(whole, view, place), fontsize=11)
    axes[0, 0].set_ylabel("before", fontsize=13)
    axes[1, 0].set_ylabel("after", fontsize=13)
    bar = figure.colorbar(shown, ax=axes[1, :], location="bottom", shrink=0.6, aspect=40, pad=0.02)
    bar.set_label("displacement [mm]   (dashed: where the surfaces were before)")
    views.legend(figure, views.tissue_entries(names, whole, resected), loc="upper right", fontsize=9)
    # the title is the user's free text, in which a dollar sign begins no formula
    figure.suptitle(f"{title}\n{subtitle}", fontsize=13, parse_math=False)
    views.save(figure, path)
    plt.close(figure)


def _draw_after(axes: Any, result: Result, faces: Ints, sizes: Floats, view: View, place: float, top: float) -> Any:
    from matplotlib.collections import PolyCollection

    mesh, moved = result.mesh, result.mesh.points + result.u
    section = cut(moved, mesh.tetrahedra, sizes, view.axis, place)
    polygons = [views.in_view(p) for p in section.polygons]
    shown = PolyCollection(polygons, array=section.values, cmap="viridis", edgecolors="face", linewidths=0.4)
    shown.set_clim(0.0, top)
    axes.add_collection(shown)
    views.draw_outline(axes, faces, moved, view, place, "-", "#1d1d1d")
    views.draw_outline(axes, faces, mesh.points, view, place, (0, (3, 2)), "#c0392b")
    return shown
