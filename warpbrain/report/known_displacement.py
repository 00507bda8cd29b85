"""How well the displacement of a result is known, as a section of its page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from warpbrain.arrays import Ints
from warpbrain.mesh import TetMesh
from warpbrain.report import views
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.generative.page import VERMILLION
from warpbrain.report.page.document import Section, section
from warpbrain.report.page.figures import TEXT, inlined, panels
from warpbrain.report.slices import cut, level_line
from warpbrain.report.state_files import LEFT, TRUST, UNSEEN, SavedState


def known_displacement(state: SavedState, whole: TetMesh, places: Sequence[float], known: str) -> Section:
    """The section; without a body where nothing is known of it.

    Parameters
    ----------
    state : SavedState
    whole : TetMesh
        The anatomy before anything was resected.
    places : sequence of float
        Of the axial, the coronal and the sagittal cut [m].
    known : str
        A sentence: what the standard deviation is of.
    """
    title = "How well the displacement is known"
    if state.deviation is None or not state.deviation.any():
        return section(title)
    at = int(state.deviation.argmax())
    moves = float(np.linalg.norm(state.u[at]))
    words = (
        f"Standard deviation of the displacement: at most {MILLIMETRES * state.deviation[at]:.2g} mm, where the body "
        f"moves by {MILLIMETRES * moves:.2g} mm. {known}"
    )
    if state.trust is not None:
        volumes = state.mesh.node_volumes
        unseen, left = (100.0 * volumes[state.trust == value].sum() / volumes.sum() for value in (UNSEEN, LEFT))
        words += (
            f" Hatched: {TRUST[UNSEEN]} of a force there, {unseen:.0f} % of the body. Dotted: {TRUST[LEFT]}, "
            f"{left:.0f} % of it."
        )
    words += " With --image: displacement_sd.nii.gz" + (" and trust.nii.gz." if state.trust is not None else ".")
    figure = inlined(lambda narrow: _figure(state, whole, places, narrow), "Three cuts with the deviation.", words)
    return section(title, figure)


def _figure(state: SavedState, whole: TetMesh, places: Sequence[float], narrow: bool) -> Any:
    assert state.deviation is not None
    values = MILLIMETRES * state.deviation
    figure, axes = panels(narrow, 3.4, 3)
    drawn: Any = None
    for panel, view, place in zip(axes, views.VIEWS, places, strict=True):
        drawn = views.draw_values(panel, state.mesh, values, view, place, float(values.max()))
        if state.trust is not None:
            _draw_trust(panel, state.mesh, state.trust, view, place)
        panel.set_title(views.heading(whole, view, place), fontsize=TEXT)
    bar = figure.colorbar(drawn, ax=axes, location="bottom", shrink=0.9 if narrow else 0.5, aspect=40, pad=0.02)
    bar.set_label("standard deviation of the displacement [mm]", fontsize=TEXT - 1)
    bar.ax.tick_params(labelsize=TEXT - 2)
    return figure


def _draw_trust(axes: Any, mesh: TetMesh, trust: Ints, view: views.View, place: float) -> None:
    """Hatch what recordings do not see; dots, and a line around them, where they and the case disagree."""
    from matplotlib.collections import LineCollection
    from matplotlib.patches import PathPatch

    section = cut(mesh.points, mesh.tetrahedra, (trust == LEFT).astype(np.float64), view.axis, place)
    of_elements = mesh.tetrahedra[section.elements]
    for value, hatch, colour in ((UNSEEN, "//////", "white"), (LEFT, "....", VERMILLION)):
        inside = (trust == value)[of_elements].mean(axis=1) > 0.5
        if inside.any():
            shape = views.path_of([polygon for polygon, here in zip(section.polygons, inside, strict=True) if here])
            axes.add_artist(
                PathPatch(shape, facecolor="none", edgecolor=colour, hatch=hatch, linewidth=0.0, zorder=2.0)
            )
    segments = views.in_view(level_line(section, 0.5))
    axes.add_collection(LineCollection(list(segments), colors=VERMILLION, linewidths=2.2, zorder=2.5))
