"""Cuts through an anatomy with what its map says: where something is significant, and where the data are blind."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.report.diagnosis.saved import Anatomy
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.generative.page import GREEN
from warpbrain.report.slices import Cut, cut, level_line
from warpbrain.report.views import View, bare, draw_outline, in_view, path_of, scale_length

#: Ground of the tissue, of what is significant, and lines of the hatching.
TISSUE, TINT, HATCHING = "#f1eeea", "#cfe6dc", "#9a938b"


def draw_slice(axes: Any, anatomy: Anatomy, view: View, place: float, threshold: float) -> Cut:
    """Draw a cut at a place [m]: tissue, hatched where the data are blind, a line around what is significant."""
    from matplotlib.collections import LineCollection
    from matplotlib.patches import PathPatch

    mesh = anatomy.mesh
    section = cut(mesh.points, mesh.tetrahedra, np.asarray(anatomy.fields["score"]), view.axis, place)
    axes.add_artist(PathPatch(path_of(section.polygons), facecolor=TISSUE, edgecolor=TISSUE, linewidth=0.3))
    significant = section.values > threshold
    if significant.any():
        inside = [polygon for polygon, here in zip(section.polygons, significant, strict=True) if here]
        axes.add_artist(PathPatch(path_of(inside), facecolor=TINT, edgecolor=TINT, linewidth=0.3))
    blind = np.asarray(anatomy.fields["blind"])[mesh.tetrahedra[section.elements]].mean(axis=1) > 0.5
    if blind.any():
        hidden = [polygon for polygon, here in zip(section.polygons, blind, strict=True) if here]
        axes.add_artist(
            PathPatch(path_of(hidden), facecolor="none", edgecolor=HATCHING, hatch="//////", linewidth=0.0, zorder=2.0)
        )
    segments = in_view(level_line(section, threshold))
    axes.add_collection(LineCollection(list(segments), colors=GREEN, linewidths=2.2))
    draw_outline(axes, mesh.boundary, mesh.points, view, place)
    return section


def frame_slice(axes: Any, anatomy: Anatomy, view: View) -> None:
    """Limits around the body, letters of the directions at the edges and a scale bar below."""
    points = anatomy.mesh.points
    length = scale_length(anatomy.mesh)
    corners = in_view(np.array([points.min(axis=0)[view.plane], points.max(axis=0)[view.plane]]))
    low, high = corners.min(axis=0) - 0.6 * length, corners.max(axis=0) + 0.6 * length
    low[1] -= 0.5 * length
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    bare(axes)
    left, right, bottom, top = view.letters
    middle = 0.5 * (corners[0] + corners[1])
    style = {"fontsize": 10, "color": "#555555", "va": "center", "ha": "center"}
    axes.text(low[0] + 0.25 * length, middle[1], left, **style)
    axes.text(high[0] - 0.25 * length, middle[1], right, **style)
    axes.text(middle[0], low[1] + 0.75 * length, bottom, **style)
    axes.text(middle[0], high[1] - 0.25 * length, top, **style)
    axes.plot([low[0], low[0] + length], [low[1] + 0.15 * length] * 2, color="#333333", linewidth=2.0)
    axes.text(low[0] + 1.1 * length, low[1] + 0.15 * length, f"{length:g} mm", fontsize=8, va="center", color="#333333")


def centre_of(summary: dict[str, Any], anatomy: Anatomy) -> Any:
    """Where to cut (3,) [m]: through what was located, else through the middle of the body."""
    where = summary["where"]
    if where is not None and "centre_m" in where:
        return np.array(where["centre_m"])
    points = anatomy.mesh.points
    # beside the midline, where a hemisphere is; elsewhere off planes that nodes of a regular mesh lie in
    return 0.5 * (points.min(axis=0) + points.max(axis=0)) + np.array([0.12, 0.003, 0.003]) * np.ptp(points, axis=0)


def millimetres(value: float) -> str:
    """A coordinate for people."""
    return f"{MILLIMETRES * value:z.0f} mm"
