"""A scene in windows of PyVista, on a screen or off it.

`python -m warpbrain.report.rendering.drawing` renders the scene that lies in the folder whose name comes on standard
input; without one it ends.
"""

import os
import pickle
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyvista

from warpbrain.arrays import Bools, Floats
from warpbrain.report.rendering import AFTER, BEFORE, COMPUTED, CUTS, MOTION, NAMES, RECORDED, SCENE, Camera, Scene

#: Colours of where surfaces were, and of arrows over colours.
GHOST, ARROW = "#c0392b", "#1d1d1d"
_U, _SIZE, _TISSUE = "u", "size", "tissue"
#: Of arrows in a cut, as parts of the size of the body: one in each square of that width.
_GRID = 0.075
#: Of the shaft of an arrow.
_SIDES = 10


def screenshot(scene: Scene, cameras: Mapping[str, Camera], size: tuple[int, int]) -> Any:
    """The pictures that have cameras side by side, (height, width * k, 3) uint8; no display is needed."""
    names = [name for name in NAMES if name in cameras]
    plotter = pyvista.Plotter(
        off_screen=True, shape=(1, len(names)), window_size=(size[0] * len(names), size[1]), border=False
    )
    for column, name in enumerate(names):
        plotter.subplot(0, column)
        camera = cameras[name]
        draw(plotter, scene, name, camera)
        plotter.camera.parallel_projection = True
        position = camera.centre + 4.0 * camera.half_height * camera.towards
        plotter.camera_position = position, camera.centre, camera.up
        plotter.camera.parallel_scale = camera.half_height
        plotter.renderer.reset_camera_clipping_range()
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return image


def draw(plotter: Any, scene: Scene, name: str, camera: Camera) -> None:
    """Draw one of `NAMES` into the present picture of a plotter."""
    plotter.set_background("white")
    if name == BEFORE:
        # what was removed is there whole, even where the corner is cut out
        gone = [_surface(_body_of(scene, scene.removed))] if scene.removed.any() else []
        for part in [*_cut_open(_body_of(scene, ~scene.removed), scene), *gone]:
            plotter.add_mesh(part, scalars=_TISSUE, rgb=True, preference="cell", **_matt(part))
    elif name == AFTER:
        _draw_after(plotter, scene, scene.exaggeration)
    elif name == MOTION:
        _draw_motion(plotter, scene)
    else:
        _draw_cut(plotter, scene, CUTS[name], camera)


def _draw_after(plotter: Any, scene: Scene, exaggeration: float) -> None:
    """The body after, a corner cut out, and, where it has gone away, a ghost of it before."""
    body = _body_of(scene, ~scene.removed)
    for part in _cut_open(body, scene):
        _coloured(plotter, part.warp_by_vector(_U, factor=exaggeration), scene, **_matt(part))
    # the far side of its surface, which the body hides but where it has left
    ghost = _cut_open(body, scene)[0]
    plotter.add_mesh(ghost, color=GHOST, opacity=0.35, culling="front", lighting=False)


def _body_of(scene: Scene, elements: Bools) -> Any:
    """Some of the tetrahedra (m,), with what they carry."""
    cells = scene.tetrahedra[elements]
    grid = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: cells}, np.asarray(scene.points, dtype=np.float64))
    grid.point_data[_U] = scene.u
    grid.point_data[_SIZE] = np.linalg.norm(scene.u, axis=1)
    grid.cell_data[_TISSUE] = scene.colours[elements]
    return grid


def _cut_open(grid: Any, scene: Scene) -> list[Any]:
    """The surface of a body without the corner on the side of the viewer, and the three faces of that corner."""
    towards, middle = scene.side, np.asarray(scene.corner)
    inside = np.all((grid.points - middle) * towards > 0.0, axis=1)
    surface = _surface(grid)
    if not inside.any():
        return [surface]
    far = 10.0 * float(np.ptp(scene.points, axis=0).max())
    low, high = np.minimum(middle, middle + far * towards), np.maximum(middle, middle + far * towards)
    bounds = np.column_stack([low, high]).ravel()
    parts = [surface.clip_box(bounds, invert=True).extract_surface(algorithm="dataset_surface")]
    for axis in range(3):
        face = grid.slice(normal=np.eye(3)[axis], origin=middle)
        for side in (k for k in range(3) if k != axis):
            if face.n_points:
                face = face.clip(normal=towards[side] * np.eye(3)[side], origin=middle, invert=False)
        face.field_data["flat"] = [1]
        parts.append(face)
    return [part for part in parts if part.n_points]


def _surface(grid: Any) -> Any:
    return grid.extract_surface(algorithm="dataset_surface")


def _matt(part: Any) -> dict[str, Any]:
    """Faces of a cut have no light and shade of their own."""
    if "flat" in part.field_data:
        return {"lighting": True, "ambient": 0.75, "diffuse": 0.3}
    return {"ambient": 0.25, "diffuse": 0.8, "specular": 0.05, "smooth_shading": True}


def _coloured(plotter: Any, part: Any, scene: Scene, **options: Any) -> None:
    table = pyvista.LookupTable(values=np.column_stack([scene.table, np.full(len(scene.table), 255)]))
    table.scalar_range = (0.0, scene.top)
    plotter.add_mesh(part, scalars=_SIZE, cmap=table, show_scalar_bar=False, preference="point", **options)


def _draw_motion(plotter: Any, scene: Scene) -> None:
    """What was recorded beside what was computed; where nothing was, how the surface moves."""
    surface = _surface(_body_of(scene, ~scene.removed))
    plotter.add_mesh(surface, color="#a89c92", opacity=0.22, smooth_shading=True, ambient=0.4)
    size = float(np.ptp(scene.points, axis=0).max())
    if len(scene.where):
        dots = pyvista.PolyData(np.asarray(scene.where, dtype=np.float64))
        plotter.add_mesh(dots, color="#333333", point_size=3.0, render_points_as_spheres=True)
        for vectors, colour in ((scene.recorded, RECORDED), (scene.computed, COMPUTED)):
            _arrows(plotter, scene.where, scene.arrows * vectors, colour, size)
        return
    used = np.unique(surface.point_data["vtkOriginalPointIds"])
    chosen = used[_thinned(scene.points[used], _GRID * size)]
    _arrows(plotter, scene.points[chosen], scene.exaggeration * scene.u[chosen], COMPUTED, size)


def _draw_cut(plotter: Any, scene: Scene, axis: int, camera: Camera) -> None:
    """A plane of the body where it went, coloured by how far, over the outline of where it was."""
    origin = np.zeros(3)
    origin[axis] = scene.places[axis]
    section = _body_of(scene, ~scene.removed).slice(normal=np.eye(3)[axis], origin=origin)
    if not section.n_points:
        return
    size = float(np.ptp(scene.points, axis=0).max())
    # lines and arrows lie in front of the plane
    lift = camera.half_height * camera.towards
    moved = section.warp_by_vector(_U, factor=scene.exaggeration)
    _coloured(plotter, moved, scene, lighting=False)
    for body, colour, width in ((section, GHOST, 2.0), (moved, ARROW, 1.5)):
        rim = body.extract_feature_edges(feature_edges=False, manifold_edges=False, non_manifold_edges=False)
        if rim.n_points:
            plotter.add_mesh(rim.translate(lift), color=colour, line_width=width, lighting=False)
    chosen = _thinned(section.points, _GRID * size)
    vectors = scene.exaggeration * section.point_data[_U][chosen]
    vectors[:, axis] = 0.0
    _arrows(plotter, section.points[chosen] + lift, vectors, ARROW, size)


def _arrows(plotter: Any, where: Floats, vectors: Floats, colour: str, size: float) -> None:
    """Arrows from places; what is too short to be seen is not drawn.

    Shafts and heads have one width, whatever the length.
    """
    lengths = np.linalg.norm(vectors, axis=1)
    seen = lengths > 0.006 * size
    if not seen.any():
        return
    where, vectors, lengths = where[seen], vectors[seen], lengths[seen]
    heads = np.minimum(0.5 * lengths, 0.028 * size)
    necks = where + (1.0 - heads / lengths)[:, None] * vectors
    # tubes from start to neck, and from neck to tip, where their radius vanishes
    lines = pyvista.line_segments_from_points(np.stack([where, necks, necks, where + vectors], axis=1).reshape(-1, 3))
    lines.point_data["radius"] = size * np.tile([0.0035, 0.0035, 0.010, 0.0], len(where))
    arrows = lines.tube(scalars="radius", absolute=True, n_sides=_SIDES)
    plotter.add_mesh(arrows, color=colour, ambient=0.45)


def _thinned(points: Floats, width: float) -> Any:
    """One point of each cube of a lattice: the one that is nearest to its middle."""
    cells = np.floor(points / width).astype(np.int64)
    off = np.linalg.norm(points / width - cells - 0.5, axis=1)
    order = np.argsort(off, kind="stable")
    return np.sort(order[np.unique(cells[order], axis=0, return_index=True)[1]])


def interactive(scene: Scene, exaggeration: float | None) -> Any:
    """A window with the body after, a slider for how far it moves, a scale and the directions of the patient."""
    at_first = scene.exaggeration if exaggeration is None else exaggeration
    plotter = pyvista.Plotter(window_size=(1200, 900))
    shown: list[Any] = []

    def show(factor: float) -> None:
        for actor in shown:
            plotter.remove_actor(actor, render=False)
        before = set(plotter.renderer.actors)
        _draw_after(plotter, scene, factor)
        shown[:] = [actor for name, actor in plotter.renderer.actors.items() if name not in before]

    plotter.set_background("white")
    show(at_first)
    plotter.add_slider_widget(
        show, (0.0, max(2.0 * at_first, 1.0)), value=at_first, title="motion: times as large as it is", fmt="%.3g",
        color="#333333", pointa=(0.35, 0.92), pointb=(0.95, 0.92), interaction_event="end", style="modern",
    )  # fmt: skip
    plotter.add_scalar_bar(
        title="displacement [mm]\n", mapper=shown[0].mapper, color="#333333", n_labels=5, fmt="%.3g", position_x=0.3
    )
    plotter.add_axes(xlabel="R", ylabel="A", zlabel="S", color="#333333")
    plotter.view_vector(tuple(scene.side * (0.8, 0.85, 0.62)), viewup=(0.0, 0.0, 1.0))
    return plotter


def _main() -> None:
    """Render; what the graphics library says of displays that are not there is nobody's business."""
    with pyvista.vtk_verbosity("off"):
        # the first one loads what is drawn with, while the scene may still be computed
        pyvista.Plotter(off_screen=True).close()
        if name := sys.stdin.read():
            scene = pickle.loads((Path(name) / SCENE).read_bytes())
            np.save(Path(name) / "pictures.npy", screenshot(*scene))


if __name__ == "__main__":
    _main()
    # VTK takes long to be taken down, and somebody waits for the pictures
    sys.stderr.flush()
    os._exit(0)
