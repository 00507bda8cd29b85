"""What a 3-D view shows, as JSON that its script reads: a surface with fields, cuts, points, arrows, a ball.

Lengths are in mm, axes RAS; arrays are 32-bit numbers in base64.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from warpbrain.arrays import Floats
from warpbrain.mesh import TetMesh
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.page import part
from warpbrain.report.page.figures import shades
from warpbrain.report.slices import plane_section


@dataclass(frozen=True, eq=False)
class Field:
    """Numbers at the nodes of a body, and how they become colours."""

    #: Of the switch, and of the bar of colours, with its unit.
    name: str
    label: str
    values: Floats
    #: Values of the first and the last colour, and one that is marked in the bar.
    low: float
    high: float
    mark: float | None = None
    #: What is said below the bar: of the mark, if there is one.
    note: str = ""


@dataclass(frozen=True, eq=False)
class Arrows:
    """Arrows (k, 3) [m] at the recorded points, of a colour as ``#rrggbb``, shown at first or not."""

    name: str
    colour: str
    vectors: Floats
    shown: bool = True


def viewer(scene: dict[str, Any], legend: str, note: str) -> Markup:
    """The view of a scene as HTML: a canvas, what switches it, a bar of colours, and its script, all in the page.

    Where a browser has no WebGL it says so, and the pictures above and below remain. `legend` is what the arrows are,
    in a word or two, `note` in a sentence.
    """
    return part("view", scene, Markup(scene_json(scene)), legend, note)


def describe_scene(
    mesh: TetMesh,
    fields: Sequence[Field],
    recorded: Floats,
    arrows: Sequence[Arrows],
    ball: tuple[Floats, float] | None = None,
    u: Floats | None = None,
    exaggeration: float = 1.0,
    cuts: Sequence[tuple[str, int, float]] = (),
) -> dict[str, Any]:
    """What is in a view: a mesh with fields, and recorded points (k, 3) [m] with arrows.

    `ball` has a centre (3,) and a radius [m]. With a displacement u (n, 3) [m] the view shows the body before and
    after, moved `exaggeration` times as far at first. `cuts` are planes that can be shown: name, axis and place [m].
    """
    used, triangles = np.unique(mesh.boundary, return_inverse=True)
    stops = shades()(np.linspace(0.0, 1.0, 9))[:, :3]
    located = None
    if ball is not None:
        located = {"centre": [MILLIMETRES * float(value) for value in ball[0]], "radius": MILLIMETRES * ball[1]}
    enlarged = 1
    if arrows and len(arrows[0].vectors):
        # how many times as long as they are arrows are drawn at first: a large one is a tenth of the body
        large = float(np.quantile(np.linalg.norm(arrows[0].vectors, axis=1), 0.95))
        size = float(np.ptp(mesh.points, axis=0).max())
        enlarged = int(np.clip(round(0.1 * size / max(large, 1e-9)), 1, 40))
    return {
        "points": _packed(MILLIMETRES * mesh.points[used]),
        "triangles": _packed(triangles.reshape(-1, 3), np.uint32),
        "moves": None if u is None else _packed(MILLIMETRES * u[used]),
        "exaggeration": exaggeration,
        "cuts": [_cut(mesh, fields, u, *cut) for cut in cuts],
        "fields": [_field(field, used) for field in fields],
        "recorded": _packed(MILLIMETRES * recorded),
        "arrows": [
            {
                "name": each.name,
                "colour": [int(each.colour[k : k + 2], 16) for k in (1, 3, 5)],
                "vectors": _packed(MILLIMETRES * each.vectors),
                "shown": each.shown,
            }
            for each in arrows
        ],
        "enlarged": enlarged,
        "ball": located,
        "colours": np.round(255.0 * stops).astype(int).tolist(),
    }


def scene_json(scene: dict[str, Any]) -> str:
    """As text that can stand in a page: nothing of it ends the element that it is in."""
    return json.dumps(scene, allow_nan=False).replace("</", "<\\/")


def _field(field: Field, used: Any) -> dict[str, Any]:
    values = np.asarray(field.values)[used]
    beyond = "≥ " if float(values.max()) > field.high else ""
    under_mark, under_bar = ("", field.note) if field.mark is None else (field.note, "")
    return {
        "name": field.name, "label": field.label, "values": _packed(values), "low": field.low, "high": field.high,
        "low_text": f"{field.low:.3g}", "high_text": f"{beyond}{field.high:.3g}",
        "mark": field.mark, "mark_text": under_mark, "note": under_bar,
    }  # fmt: skip


def _cut(
    mesh: TetMesh, fields: Sequence[Field], u: Floats | None, name: str, axis: int, place: float
) -> dict[str, Any]:
    """A plane through the body with what its fields and its displacement are there."""
    section = plane_section(mesh.points, mesh.tetrahedra, axis, place)
    return {
        "name": name,
        "points": _packed(MILLIMETRES * section.at_points(mesh.points)),
        "triangles": _packed(section.triangles, np.uint32),
        "moves": None if u is None else _packed(MILLIMETRES * section.at_points(u)),
        "values": [_packed(section.at_points(np.asarray(field.values, dtype=np.float64))) for field in fields],
    }


def _packed(values: Any, kind: Any = np.float32) -> str:
    """The bytes of an array, little end first, in base64."""
    return base64.b64encode(np.ascontiguousarray(values, np.dtype(kind).newbyteorder("<")).tobytes()).decode()
