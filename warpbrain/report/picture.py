"""The picture of a run: the anatomy before, after, and what was recorded of it, as PyVista renders them."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.cases.case import Case
from warpbrain.mesh import TetMesh
from warpbrain.recordings.recording import PointsRecording, Recording
from warpbrain.report import rendering, views
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.rendering import RenderingError, render
from warpbrain.threads import beside

#: Pixels of one picture.
_SIZE = (640, 560)
#: A large displacement is drawn this long, and a large recorded one, as parts of the size of the body.
_MOVED, _RECORDED = 0.11, 0.15


@dataclass(frozen=True, eq=False)
class Moved:
    """Points that were recorded, how far they moved, and how far the simulation has them move, all (k, 3) [m]."""

    where: Floats
    recorded: Floats
    computed: Floats

    @classmethod
    def of(cls, recordings: Sequence[Recording], compared: Iterable[tuple[str, Ints, Floats, Floats]]) -> Self:
        """Of all recordings of displacements at points; of each `compared` one its name, its rows (n,), and what is
        left there (n, 3) [m] with nothing moved and with the simulation."""
        by_name = {recording.name: recording for recording in recordings}
        moves = [np.zeros((0, 9))]
        for name, rows, before, after in compared:
            recording = by_name[name]
            if isinstance(recording, PointsRecording):
                moves.append(np.column_stack([recording.points[rows], before, before - after]))
        return cls(*np.split(np.concatenate(moves), 3, axis=1))


@dataclass(frozen=True, eq=False)
class Pictures:
    """Renderings of a scene, and what makes a figure of them."""

    scene: rendering.Scene
    cameras: dict[str, rendering.Camera]
    #: The anatomy, elements (m,) of it that were taken out, and the names of its tissues.
    whole: TetMesh
    resected: Bools
    names: dict[int, str]
    _rendered: Callable[[], dict[str, Any]]

    @cached_property
    def images(self) -> dict[str, Any]:
        """The pictures (height, width, 3) uint8 by name, when they are there; `RenderingError` if none can be here."""
        return self._rendered()


def begin_pictures(case: Case, u: Floats, moved: Moved) -> Pictures:
    """Begin to render the body of a case, beside what else there is to do.

    u (n, 3) [m] is the displacement of the nodes that are left of it if anything was resected.

    To be called where `ready_to_render` lasts: rendering ends with it.
    """
    whole, names = case.mesh, {label: tissue.name for label, tissue in case.tissues.items()}
    resected = np.zeros(len(whole.tetrahedra), dtype=bool)
    if case.resection is not None:
        resected = whole.element_sets[case.resection.elements]
    displacement = np.zeros_like(whole.points)
    displacement[case.remaining[1]] = u
    scene = scene_of(whole, resected, displacement, names, moved)
    cameras = cameras_of(scene)
    rendered = beside(lambda: render(scene, cameras, _SIZE))
    return Pictures(scene, cameras, whole, resected, names, rendered)


def scene_of(mesh: TetMesh, removed: Bools, u: Floats, names: dict[int, str], moved: Moved) -> rendering.Scene:
    """What is drawn of a body displaced by u (n, 3) [m], of which elements (m,) were removed before it moved; `names`
    are those of its tissues, by label."""
    from matplotlib import colormaps
    from matplotlib.colors import to_rgb

    left = np.unique(mesh.tetrahedra[~removed])
    size = MILLIMETRES * float(np.ptp(mesh.points, axis=0).max())
    by_label = {label: to_rgb(colour) for label, colour in views.tissue_colours(names, mesh).items()}
    colours = np.array([by_label[label] for label in mesh.tissue.tolist()])
    colours[removed] = to_rgb(views.RESECTED)
    large = MILLIMETRES * float(np.percentile(np.linalg.norm(u[left], axis=1), 99.5))
    recorded = MILLIMETRES * np.linalg.norm(moved.recorded, axis=1)
    places = np.array(views.places(mesh, removed))[::-1]
    ventricle = mesh.node_sets.get("ventricle", np.zeros(len(mesh.points), dtype=bool))
    middle = 0.5 * (mesh.points.min(axis=0) + mesh.points.max(axis=0))
    corner = mesh.points[ventricle].mean(axis=0) if ventricle.any() else middle
    # two cuts through what was resected and an axial one through the ventricles say more than three through one place
    places[2] = corner[2]
    return rendering.Scene(
        points=MILLIMETRES * mesh.points,
        tetrahedra=mesh.tetrahedra.astype(np.int64),
        removed=removed,
        colours=np.round(255.0 * colours).astype(np.uint8),
        u=MILLIMETRES * u,
        exaggeration=round_factor(_MOVED * size, large),
        corner=MILLIMETRES * corner,
        places=MILLIMETRES * places,
        where=MILLIMETRES * moved.where,
        recorded=MILLIMETRES * moved.recorded,
        computed=MILLIMETRES * moved.computed,
        arrows=round_factor(_RECORDED * size, float(np.percentile(recorded, 95))) if len(recorded) else 1.0,
        top=max(large, 1e-3),
        table=np.round(255.0 * colormaps["viridis"](np.linspace(0.0, 1.0, 256))[:, :3]).astype(np.uint8),
    )


def round_factor(wanted: float, length: float) -> float:
    """How many times as long as it is a length is drawn: 1, 2 or 5 and zeros, never less than 1, 1 of what is not."""
    if length < 1e-6 * wanted:
        return 1.0
    return views.round_below(max(1.0, wanted / length) * (1.0 + 1e-9))


def cameras_of(scene: rendering.Scene) -> dict[str, rendering.Camera]:
    """Where each picture is seen from: the body, before and after, fills it."""
    moved = scene.points + scene.exaggeration * scene.u
    everything = np.concatenate([scene.points, moved[np.unique(scene.tetrahedra[~scene.removed])]])
    tips = np.concatenate([everything, scene.where + scene.arrows * scene.recorded])
    x, y, z = np.eye(3)
    cameras = {}
    # what points to the viewer, and what is above
    for name, towards, above, points in (
        (rendering.BEFORE, scene.side * [0.80, 0.85, 0.62], z, everything),
        (rendering.AFTER, scene.side * [0.80, 0.85, 0.62], z, everything),
        (rendering.MOTION, scene.side * [1.0, 0.25, 0.12], z, tips),
        (rendering.AXIAL, -z, y, everything),
        (rendering.CORONAL, y, z, everything),
        (rendering.SAGITTAL, -x, z, everything),
    ):
        right = np.cross(above, towards)
        right /= np.linalg.norm(right)
        up = np.cross(towards / np.linalg.norm(towards), right)
        axes = np.column_stack([right, up, np.cross(right, up)])
        low, high = (points @ axes).min(axis=0), (points @ axes).max(axis=0)
        centre = axes @ (0.5 * (low + high))
        half_width, half_height, _ = 0.5 * (high - low)
        # room for letters and a scale bar
        half_height = 1.14 * float(max(half_height, half_width * _SIZE[1] / _SIZE[0], 1e-3))
        cameras[name] = rendering.Camera(right, up, centre, half_height)
    return cameras


def draw(path: Path, pictures: Pictures, title: str, subtitles: Sequence[str]) -> Pictures | str:
    """Write the pictures of a deformed body below a title and more lines.

    Returns them, or why, if nothing can be rendered here: no picture is then left at `path`, which would be one of
    something else.
    """
    from matplotlib.cm import ScalarMappable

    lines = len(subtitles) + 1
    high = 9.8 + 0.24 * lines
    figure, axes = views.panels(2, 3, (13.8, high))
    # room for the title, which has any number of lines
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, 1.0 - 0.24 * lines / high))
    scene = pictures.scene
    shown = {}
    for panel, name in zip(axes, pictures.cameras, strict=True):
        notes = notes_on(pictures.cameras[name], _SIZE[::-1], pictures.whole)
        shown[name] = show(panel, np.full((*_SIZE[::-1], 3), 255, np.uint8), notes)
        panel.set_title(heading(pictures, name), fontsize=10)
    shades = ScalarMappable(cmap="viridis")
    shades.set_clim(0.0, scene.top)
    label = "displacement [mm]; red: where it was before"
    figure.colorbar(shades, ax=axes, location="bottom", shrink=0.7, aspect=45, pad=0.01, label=label)
    entries = views.tissue_entries(pictures.names, pictures.whole, pictures.resected)
    entries += [(views.line(color=colour, linewidth=2.5), name) for name, colour in arrow_colours(scene).items()]
    views.legend(figure, entries, loc="outside lower center", fontsize=9, ncols=6)
    views.entitle(figure, "\n".join([title, *subtitles]), y=1.0 - 0.08 / high, va="top")
    # while pictures are rendered
    views.lay_out(figure)
    try:
        images = pictures.images
    except RenderingError as error:
        path.unlink(missing_ok=True)
        return str(error)
    for name, image in images.items():
        shown[name].set_data(image)
    views.save(figure, path)
    return pictures


def arrow_colours(scene: rendering.Scene) -> dict[str, str]:
    """What arrows of displacements mean, and their colours."""
    computed = {"computed displacement": rendering.COMPUTED}
    return {"recorded displacement": rendering.RECORDED, **computed} if len(scene.where) else computed


def heading(pictures: Pictures, name: str) -> str:
    """What stands above a picture, in two lines."""
    scene, factor = pictures.scene, pictures.scene.exaggeration
    if name == rendering.BEFORE:
        return "before\n"
    if name == rendering.AFTER:
        above = "after"
    elif name == rendering.MOTION:
        above = "recorded and computed" if len(scene.where) else "how the surface moves"
        factor = scene.arrows if len(scene.where) else factor
    else:
        view = next(view for view in views.VIEWS if view.axis == rendering.CUTS[name])
        above = views.heading(pictures.whole, view, float(scene.places[view.axis]) / MILLIMETRES)
    return f"{above}\n" + ("motion as large as it is" if factor == 1.0 else f"motion {factor:g} times as large")


@dataclass(frozen=True)
class Annotations:
    """Letters and lines on a picture, in mm from its middle to the right and up."""

    #: Half the width and half the height of the picture.
    across: float
    high: float
    #: Where, and which direction of the patient that is.
    letters: tuple[tuple[float, float, str], ...]
    #: From and to: of the directions, where they are not those of the picture.
    lines: tuple[tuple[float, float, float, float], ...]
    #: Left end and height of the scale bar, its length, and the words.
    bar: tuple[float, float, float, str]


def notes_on(
    camera: rendering.Camera,
    shape: tuple[int, ...],
    whole: TetMesh,
    ends: Sequence[str] = ("R", "A", "S", "L", "P", "I"),
) -> Annotations:
    """What is written on a picture (height, width, ...) of a body; `ends` are those of x, y and z, then the others."""
    high = camera.half_height
    across = high * shape[1] / shape[0]
    letters, lines = [], []
    if np.abs(camera.towards).max() > 0.999:
        for x, y, direction in (
            *((-0.88 * across, 0.0, -camera.right), (0.88 * across, 0.0, camera.right)),
            *((0.0, -0.95 * high, -camera.up), (0.0, 0.95 * high, camera.up)),
        ):
            axis = int(np.argmax(np.abs(direction)))
            letters.append((x, y, ends[axis] if direction[axis] > 0.0 else ends[axis + 3]))
    else:
        x, y, length = 0.84 * across, -0.80 * high, 0.11 * high
        for axis, letter in enumerate(ends[:3]):
            right, up = length * float(camera.right[axis]), length * float(camera.up[axis])
            # what points to the viewer has no direction here
            if math.hypot(right, up) > 0.35 * length:
                lines.append((x, y, x + right, y + up))
                letters.append((x + 1.4 * right, y + 1.4 * up, letter))
    length = views.scale_length(whole)
    bar = (-0.94 * across, -0.93 * high, length, f"{length:g} mm")
    return Annotations(across, high, tuple(letters), tuple(lines), bar)


def show(panel: Any, image: Any, notes: Annotations) -> Any:
    """Draw a picture and what is written on it into a panel of a figure, whose units are then mm from its middle.

    Returns what shows the picture.
    """
    shown = panel.imshow(image, extent=(-notes.across, notes.across, -notes.high, notes.high))
    views.bare(panel)
    for x, y, letter in notes.letters:
        panel.text(x, y, letter, fontsize=10, color="#6a6a6a", va="center", ha="center")
    for x, y, to_x, to_y in notes.lines:
        panel.plot([x, to_x], [y, to_y], color="#6a6a6a", linewidth=1.2)
    left, low, length, words = notes.bar
    panel.plot([left, left + length], [low, low], color="#333333", linewidth=2.0)
    panel.text(left + 0.5 * length, low + 0.03 * notes.high, words, fontsize=8, ha="center", color="#333333")
    return shown
