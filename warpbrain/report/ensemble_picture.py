"""The picture of an ensemble: three cuts of the anatomy at rest, coloured by how far the samples move and differ."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpbrain.ensemble.results import Fields
from warpbrain.report import views
from warpbrain.report.files import MILLIMETRES


def write_spread_picture(path: Path, fields: Fields, title: str, subtitle: str) -> None:
    """Draw the median of the displacement's size, and its standard deviation as `displacement_sd.nii.gz` has it.

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
    shown = (
        ("median", fields.size.percentiles[50]),
        ("standard deviation", np.linalg.norm(fields.components.sd, axis=1)),
    )
    for row, (name, metres) in enumerate(shown):
        values = MILLIMETRES * metres
        top = max(float(np.percentile(values, 99.5)), 1e-6)
        for column, (view, place) in enumerate(
            zip(views.VIEWS, views.places(mesh, views.resected_elements(mesh)), strict=True)
        ):
            drawn = views.draw_values(axes[row, column], mesh, values, view, place, top)
            if row == 0:
                axes[row, column].set_title(views.heading(mesh, view, place), fontsize=11)
        axes[row, 0].set_ylabel(name, fontsize=13)
        bar = figure.colorbar(drawn, ax=axes[row, :], location="right", shrink=0.8, aspect=30, pad=0.01)
        bar.set_label(f"{name} of the displacement [mm]")
    # the title is the user's free text, in which a dollar sign begins no formula
    figure.suptitle(f"{title}\n{subtitle}", fontsize=13, parse_math=False)
    views.save(figure, path)
    plt.close(figure)
