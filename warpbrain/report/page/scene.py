"""What a 3-D view shows, as JSON that its script reads: a surface with fields, cuts, points, arrows, a ball.

Lengths are in mm, axes RAS; arrays are 32-bit numbers in base64.
"""

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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


@dataclass(frozen=True, eq=False)
class View:
    """What is in a view: a mesh with fields, recorded points (k, 3) [m] with arrows, and perhaps more."""

    mesh: TetMesh
    fields: Sequence[Field]
    recorded: Floats
    arrows: Sequence[Arrows] = ()
    #: Centre (3,) and radius [m].
    ball: tuple[Floats, float] | None = None
    #: Displacement (n, 3) of the nodes [m], with which the view shows the body before and after; and how many times as
    #: far as it moves the body is shown after, at first.
    u: Floats | None = None
    exaggeration: float = 1.0
    #: Planes that can be shown, by name: axis and place [m].
    cuts: Mapping[str, tuple[int, float]] = field(default_factory=dict)


def viewer(view: View, legend: str, note: str) -> Markup:
    """The view as HTML: a canvas, what switches it, a bar of colours, and its script, all in the page.

    Where a browser has no WebGL it says so, and the pictures above and below remain. `legend` is what the arrows are,
    in a word or two, `note` in a sentence.
    """
    scene = describe_scene(view)
    return part("view", scene, Markup(scene_json(scene)), legend, note)


def describe_scene(view: View) -> dict[str, Any]:
    """The scene of a view."""
    mesh = view.mesh
    used, triangles = np.unique(mesh.boundary, return_inverse=True)
    stops = shades()(np.linspace(0.0, 1.0, 9))[:, :3]
    ball = None
    if view.ball is not None:
        centre, radius = view.ball
        ball = {"centre": [MILLIMETRES * float(value) for value in centre], "radius": MILLIMETRES * radius}
    enlarged = 1
    if view.arrows and len(view.arrows[0].vectors):
        # how many times as long as they are arrows are drawn at first: a large one is a tenth of the body
        large = float(np.quantile(np.linalg.norm(view.arrows[0].vectors, axis=1), 0.95))
        size = float(np.ptp(mesh.points, axis=0).max())
        enlarged = int(np.clip(round(0.1 * size / max(large, 1e-9)), 1, 40))
    return {
        "points": _packed(MILLIMETRES * mesh.points[used]),
        "triangles": _packed(triangles.reshape(-1, 3), np.uint32),
        "moves": None if view.u is None else _packed(MILLIMETRES * view.u[used]),
        "exaggeration": view.exaggeration,
        "cuts": [_cut(view, name, axis, place) for name, (axis, place) in view.cuts.items()],
        "fields": [_field(field, used) for field in view.fields],
        "recorded": _packed(MILLIMETRES * view.recorded),
        "arrows": [
            {
                "name": arrows.name,
                "colour": [int(arrows.colour[k : k + 2], 16) for k in (1, 3, 5)],
                "vectors": _packed(MILLIMETRES * arrows.vectors),
                "shown": arrows.shown,
            }
            for arrows in view.arrows
        ],
        "enlarged": enlarged,
        "ball": ball,
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


def _cut(view: View, name: str, axis: int, place: float) -> dict[str, Any]:
    """A plane through the body with what its fields and its displacement are there."""
    mesh = view.mesh
    section = plane_section(mesh.points, mesh.tetrahedra, axis, place)
    return {
        "name": name,
        "points": _packed(MILLIMETRES * section.at_points(mesh.points)),
        "triangles": _packed(section.triangles, np.uint32),
        "moves": None if view.u is None else _packed(MILLIMETRES * section.at_points(view.u)),
        "values": [_packed(section.at_points(np.asarray(field.values, dtype=np.float64))) for field in view.fields],
    }


def _packed(values: Any, kind: Any = np.float32) -> str:
    """The bytes of an array, little end first, in base64."""
    return base64.b64encode(np.ascontiguousarray(values, np.dtype(kind).newbyteorder("<")).tobytes()).decode()
