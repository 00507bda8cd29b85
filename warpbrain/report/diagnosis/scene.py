"""What the 3-D view of a report shows, as JSON that its script reads: surface, fields, points, arrows, ball."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.report.diagnosis.figures.drawing import COLOURS, shades
from warpbrain.report.diagnosis.saved import STATES, Anatomy, Rows
from warpbrain.report.files import MILLIMETRES


def describe_scene(summary: dict[str, Any], anatomy: Anatomy, rows: Rows | None) -> dict[str, Any]:
    """The scene, lengths in mm; arrays are 32-bit numbers in base64."""
    faces = anatomy.mesh.boundary
    used, triangles = np.unique(faces, return_inverse=True)
    where = summary["where"]
    ball = None
    if where is not None and "centre_m" in where:
        centre = [MILLIMETRES * value for value in where["centre_m"]]
        ball = {"centre": centre, "radius": MILLIMETRES * where["radius_m"]}
    recorded, arrows, enlarged = np.zeros((0, 3)), [], 1
    if rows is not None:
        vectors = rows.vectors
        counted = ~vectors.aside
        recorded = vectors.where[counted]
        enlarged = _enlarged(vectors.left["declared"][counted], anatomy)
        arrows = [
            {
                "name": STATES[state],
                "colour": [int(COLOURS[state][k : k + 2], 16) for k in (1, 3, 5)],
                "vectors": _packed(MILLIMETRES * left[counted]),
                # before and after: what lies between them is a click away
                "shown": state in ("declared", list(vectors.left)[-1]),
            }
            for state, left in vectors.left.items()
        ]
    stops = shades()(np.linspace(0.0, 1.0, 9))[:, :3]
    return {
        "points": _packed(MILLIMETRES * anatomy.mesh.points[used]),
        "triangles": _packed(triangles.reshape(-1, 3), np.uint32),
        "fields": _fields(summary, anatomy, used),
        "recorded": _packed(MILLIMETRES * recorded),
        "arrows": arrows,
        "enlarged": enlarged,
        "ball": ball,
        "colours": np.round(255.0 * stops).astype(int).tolist(),
    }


def _enlarged(left: Floats, anatomy: Anatomy) -> int:
    """How many times as long as they are arrows are drawn at first: a large one is a tenth of the body."""
    large = float(np.quantile(np.linalg.norm(left, axis=1), 0.95))
    size = float(np.ptp(anatomy.mesh.points, axis=0).max())
    return int(np.clip(round(0.1 * size / max(large, 1e-9)), 1, 40))


def scene_json(scene: dict[str, Any]) -> str:
    """As text that can stand in a page: nothing of it ends the element that it is in."""
    return json.dumps(scene, allow_nan=False).replace("</", "<\\/")


def _fields(summary: dict[str, Any], anatomy: Anatomy, used: NDArray[np.integer]) -> list[dict[str, Any]]:
    score = np.asarray(anatomy.fields["score"])[used]
    force = np.asarray(anatomy.fields["detectable_force"])[used]
    moved = np.linalg.norm(np.asarray(anatomy.fields["displacement"])[used], axis=1)
    threshold, blind = summary["map"]["threshold"], MILLIMETRES * summary["map"]["blind_above_n"]
    # a few hidden places need a force beyond all others: they are as dark as what is blind twice over
    return [
        _field("significance", "score of a force there", score, 0.0, max(float(score.max()), threshold), threshold,
               f"significant above {threshold:.1f}", ""),
        _field("detectable force", "smallest force that is found there [mN]", force, 0.0, 2.0 * blind, blind,
               f"the data cannot see above {blind:.0f} mN", ""),
        _field("displacement", "displacement of the base state [mm]", moved, 0.0, float(moved.max()) or 1.0, None, "",
               "the case with its tissue refitted, nothing else added"),
    ]  # fmt: skip


def _field(
    name: str, label: str, values: Floats, low: float, high: float, mark: float | None, mark_text: str, note: str
) -> dict[str, Any]:
    beyond = "≥ " if float(values.max()) > high else ""
    return {
        "name": name,
        "label": label,
        "values": _packed(values),
        "low": low,
        "high": high,
        "low_text": f"{low:.3g}",
        "high_text": f"{beyond}{high:.3g}",
        "mark": mark,
        "mark_text": mark_text,
        "note": note,
    }


def _packed(values: Any, kind: Any = np.float32) -> str:
    """The bytes of an array, little end first, in base64."""
    return base64.b64encode(np.ascontiguousarray(values, np.dtype(kind).newbyteorder("<")).tobytes()).decode()
