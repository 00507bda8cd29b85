"""What the 3-D view of a diagnosis shows: where something is, what the data see, what is left at recorded points."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.report.diagnosis.figures.states import COLOURS
from warpbrain.report.diagnosis.saved import STATES, Anatomy, Rows
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.page.scene import Arrows, Field, View


def view_of(summary: dict[str, Any], anatomy: Anatomy, rows: Rows | None) -> View:
    """The view."""
    where, ball = summary["where"], None
    if where is not None and "centre_m" in where:
        ball = (np.array(where["centre_m"]), float(where["radius_m"]))
    recorded, arrows = np.zeros((0, 3)), []
    if rows is not None:
        vectors = rows.vectors
        counted = ~vectors.aside
        recorded = vectors.where[counted]
        # before and after: what lies between them is a click away
        ends = ("declared", list(vectors.left)[-1])
        arrows = [
            Arrows(STATES[state], COLOURS[state], left[counted], state in ends) for state, left in vectors.left.items()
        ]
    return View(anatomy.mesh, _fields(summary, anatomy), recorded, arrows, ball)


def _fields(summary: dict[str, Any], anatomy: Anatomy) -> list[Field]:
    score, force = (np.asarray(anatomy.fields[name]) for name in ("score", "detectable_force"))
    moved = np.linalg.norm(np.asarray(anatomy.fields["displacement"]), axis=1)
    threshold, blind = summary["map"]["threshold"], MILLIMETRES * summary["map"]["blind_above_n"]
    # only the surface is coloured
    on_it = np.unique(anatomy.mesh.boundary)
    # a few hidden places need a force beyond all others: they are as dark as what is blind twice over
    return [
        Field("significance", "score of a force there [1]", score, 0.0, max(float(score[on_it].max()), threshold),
              threshold, f"significant above {threshold:.1f}"),
        Field("detectable force", "smallest force that is found there [mN]", force, 0.0, 2.0 * blind, blind,
              f"the data cannot see above {blind:.0f} mN"),
        Field("displacement", "displacement of the base state [mm]", moved, 0.0, float(moved[on_it].max()) or 1.0, None,
              "the case with its tissue refitted, nothing else added"),
    ]  # fmt: skip
