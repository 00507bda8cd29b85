"""What a mechanism does to the phantom, in a picture: same cut, same colours and same magnification for all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.mesh import TetMesh
from warpbrain.report import views
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.slices import cut, outline

Floats = NDArray[np.float64]

#: Where the phantom is cut, normal to y [m]: through the middle of its ball.
PLACE = -0.015
#: How much differences of displacement are magnified, and where their colours end [mm].
MAGNIFIED, LARGEST = 8.0, 2.0
#: Distance of arrows and the shortest difference that has one [mm]; how far from the cut nodes are shown [m].
_SPACING, _SHORTEST, _NEAR = 12.0, 0.15, 0.008
#: Colour, mark and name of each node set that is shown; colours of Okabe and Ito.
_MARKS = {
    "fixed": ("#0072B2", "s", "held"),
    "superior": ("#D55E00", "v", "light load"),
    "side": ("#009E73", "D", "side"),
    "falx": ("#E69F00", "o", "falx"),
}
#: The ball, and the edges of its elements: they tell it from tissue in a grey print.
_BALL, _BALL_EDGE = "#CC79A7", "#5D3049"

#: Every colour of a picture but those of the scale and greys.
INKS = (*(colour for colour, _, _ in _MARKS.values()), _BALL, _BALL_EDGE, *views.TISSUE_COLOURS[:2])


def write_picture(path: Path, case: Case, mesh: TetMesh, difference: Floats, title: str) -> None:
    """Draw the phantom, and how much farther it moves with a mechanism than without.

    Parameters
    ----------
    path : Path
        PNG file.
    case : Case
        The phantom under its light load.
    mesh : TetMesh
        What of it is there with the mechanism.
    difference : (n, 3) array
        Displacement of the nodes of that mesh with the mechanism, less that without [m].
    title : str
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 5.0), sharex=True, sharey=True, constrained_layout=True)
    _draw_phantom(left, case)
    shown = _draw_effect(right, case.mesh, mesh, difference)
    left.set_title("the phantom, undeformed", fontsize=11)
    right.set_title(f"{title}: what it adds, {MAGNIFIED:g} times as large", fontsize=11)
    left.set_ylabel("z [mm], up")
    low, high = (MILLIMETRES * end for end in (case.mesh.points.min(axis=0), case.mesh.points.max(axis=0)))
    for axes in (left, right):
        axes.set_xlabel("x [mm], the patient's right is on the left")
        axes.set_aspect("equal")
        axes.set_xlim(high[0] + 12.0, low[0] - 12.0)
        axes.set_ylim(low[2] + 2.0, high[2] + 14.0)
        axes.spines[["top", "right"]].set_visible(False)
    bar = figure.colorbar(shown, ax=right, shrink=0.85, pad=0.02, extend="max")
    bar.set_label("difference of displacement [mm]")
    views.save(figure, path)
    plt.close(figure)


def _draw_phantom(axes: Any, case: Case) -> None:
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patches import Patch

    mesh = case.mesh
    section = cut(mesh.points, mesh.tetrahedra, np.zeros(len(mesh.points)), 1, PLACE)
    polygons = [MILLIMETRES * polygon for polygon in section.polygons]
    colours = views.element_colours(mesh, np.zeros(len(mesh.tetrahedra), dtype=bool))[section.elements]
    ball = mesh.element_sets["ball"][section.elements]
    fills, rims = (np.where(ball, colour, colours).tolist() for colour in (_BALL, _BALL_EDGE))
    axes.add_collection(PolyCollection(polygons, facecolors=fills, edgecolors=rims, linewidths=0.4))
    edges = MILLIMETRES * outline(mesh.points, mesh.boundary, 1, PLACE)
    axes.add_collection(LineCollection(list(edges), colors=views.TISSUE_EDGE, linewidths=0.9))
    near = np.abs(mesh.points[:, 1] - PLACE) < _NEAR
    entries: list[tuple[Any, str]] = [(Patch(facecolor=_BALL, edgecolor=_BALL_EDGE), "ball")]
    for name, (colour, mark, label) in _MARKS.items():
        x = MILLIMETRES * mesh.points[mesh.node_sets[name] & near]
        [drawn] = axes.plot(x[:, 0], x[:, 2], mark, color=colour, markersize=4.5, markeredgecolor="white", mew=0.4)
        entries.append((drawn, label))
    names = {label: tissue.name for label, tissue in case.tissues.items()}
    entries = [*views.tissue_entries(names, mesh, np.zeros(len(mesh.tissue), dtype=bool)), *entries]
    axes.legend(*zip(*entries, strict=True), loc="lower center", ncols=4, fontsize=8, frameon=False)


def _draw_effect(axes: Any, whole: TetMesh, mesh: TetMesh, difference: Floats) -> Any:
    from matplotlib.collections import LineCollection, PolyCollection

    moved = mesh.points + MAGNIFIED * difference
    sizes = MILLIMETRES * np.linalg.norm(difference, axis=1)
    section = cut(moved, mesh.tetrahedra, sizes, 1, PLACE)
    polygons = [MILLIMETRES * polygon for polygon in section.polygons]
    shown = PolyCollection(polygons, array=section.values, cmap="viridis", edgecolors="face", linewidths=0.4)
    shown.set_clim(0.0, LARGEST)
    axes.add_collection(shown)
    for body, points, style in ((mesh, moved, "-"), (whole, whole.points, (0, (3, 2)))):
        edges = MILLIMETRES * outline(points, body.boundary, 1, PLACE)
        axes.add_collection(LineCollection(list(edges), colors="#1d1d1d", linestyles=[style], linewidths=0.9))
    shows = np.flatnonzero((np.abs(mesh.points[:, 1] - PLACE) < _NEAR) & (sizes > _SHORTEST))
    cells = np.round(MILLIMETRES * mesh.points[shows][:, [0, 2]] / _SPACING)
    # of the nodes of a cell the first: one arrow is enough
    shows = shows[np.unique(cells, axis=0, return_index=True)[1]]
    x, d = MILLIMETRES * mesh.points[shows], MAGNIFIED * MILLIMETRES * difference[shows]
    axes.quiver(
        x[:, 0], x[:, 2], d[:, 0], d[:, 2],
        angles="xy", scale_units="xy", scale=1.0, width=0.004, color="white", edgecolor="black", linewidth=0.6,
    )  # fmt: skip
    return shown
