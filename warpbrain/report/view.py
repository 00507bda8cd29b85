"""A saved deformed body to look at: in a window of PyVista, or as a page for a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.report import views
from warpbrain.report.body_sections import fields_of, in_three_dimensions
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.generative.page import QUIET
from warpbrain.report.page.document import document, header, write_document
from warpbrain.report.picture import Moved, scene_of
from warpbrain.report.state_files import SavedState

_NO_POINTS = Moved(*np.zeros((3, 0, 3)))


def show(state: SavedState, exaggeration: float | None) -> None:
    """Open a window and wait until it is closed; `exaggeration` is chosen if it is None."""
    window(state, exaggeration, off_screen=False).show(title=f"warpbrain: {state.path}")


def window(state: SavedState, exaggeration: float | None, off_screen: bool) -> Any:
    """The window, before it is shown: a PyVista plotter."""
    # a graphics library is asked for here only
    from warpbrain.report.rendering.drawing import interactive

    return interactive(scene_of(state.mesh, state.mesh, state.u, {}, _NO_POINTS), exaggeration, off_screen)


def write_view_page(path: Path, state: SavedState, exaggeration: float | None) -> None:
    """Write the body as one HTML file; `exaggeration` is chosen if it is None."""
    places = views.places(state.mesh, views.resected_elements(state.mesh))
    body = in_three_dimensions(state.mesh, state.u, fields_of(state), _NO_POINTS, places, exaggeration)
    largest = MILLIMETRES * float(np.linalg.norm(state.u, axis=1).max())
    facts = [("largest displacement", f"{largest:.3g} mm"), ("nodes", f"{len(state.mesh.points)}")]
    top = header(str(state.path), "a deformed body", [], facts)
    write_document(path, document(f"warpbrain: {state.path.name}", top, [body], (QUIET, "#ffffff")))
