"""The picture of an ensemble: three cuts, coloured by the samples' median displacement and by how far they differ."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.ensemble.results import Fields
from warpbrain.mesh import TetMesh, boundary_faces
from warpbrain.report import views
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.slices import cut
from warpbrain.report.views import View


def write_spread_picture(path: Path, fields: Fields, title: str, subtitle: str) -> None:
    """Draw the median and the standard deviation of the displacement's size, in the undeformed anatomy.

    Parameters
    ----------
    path : Path
        PNG file.
    fields : Fields
    title, subtitle : str
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    mesh = fields.mesh
    figure, axes = plt.subplots(2, 3, figsize=(13.5, 9.4), constrained_layout=True)
    shown = (("median", fields.size.percentiles[50]), ("standard deviation", fields.size.sd))
    for row, (name, metres) in enumerate(shown):
        values = MILLIMETRES * metres
        top = max(float(np.percentile(values, 99.5)), 1e-6)
        for column, (view, place) in enumerate(
            zip(views.VIEWS, views.places(mesh, views.resected_elements(mesh)), strict=True)
        ):
            drawn = _draw(axes[row, column], mesh, values, view, place, top)
            if row == 0:
                axes[row, column].set_title(views.heading(mesh, view, place), fontsize=11)
        axes[row, 0].set_ylabel(name, fontsize=13)
        bar = figure.colorbar(drawn, ax=axes[row, :], location="right", shrink=0.8, aspect=30, pad=0.01)
        bar.set_label(f"{name} of the displacement [mm]")
    # the title is the user's free text, in which a dollar sign begins no formula
    figure.suptitle(f"{title}\n{subtitle}", fontsize=13, parse_math=False)
    views.save(figure, path)
    plt.close(figure)


def _draw(axes: Any, mesh: TetMesh, values: Floats, view: View, place: float, top: float) -> Any:
    from matplotlib.collections import PolyCollection

    section = cut(mesh.points, mesh.tetrahedra, values, view.axis, place)
    polygons = [views.in_view(p) for p in section.polygons]
    drawn = PolyCollection(polygons, array=section.values, cmap="viridis", edgecolors="face", linewidths=0.4)
    drawn.set_clim(0.0, top)
    axes.add_collection(drawn)
    views.draw_outline(axes, boundary_faces(mesh.tetrahedra), mesh.points, view, place)
    views.frame(axes, mesh, view)
    return drawn
