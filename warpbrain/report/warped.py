"""A result as other programs open it: displacement, transforms, warped images, moved points, a scene for Slicer."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.atomic import write_text
from warpbrain.errors import InputError
from warpbrain.images.continuation import LENGTH
from warpbrain.images.displacement import DisplacementField, displacement_field, inverse, resampled
from warpbrain.images.grid import Grid, VoxelsInside, voxels_inside
from warpbrain.images.moving_points import PointFile, move_points, read_point_file, write_moved
from warpbrain.images.reading import Image, labels_of, read_image, require
from warpbrain.images.writing import write_displacement, write_transform, write_volume
from warpbrain.mesh import TetMesh
from warpbrain.recordings.electrodes import is_electrodes
from warpbrain.report.files import LEFT, MILLIMETRES, SEEN, TRUST, UNSEEN, SavedState, write_body
from warpbrain.report.page import lines, rendered

#: Names of the transforms: what they do to an image.
FORTH, BACK = "transform-before-to-after.nii.gz", "transform-after-to-before.nii.gz"
#: Maps of where not to believe the displacement.
DEVIATION, TRUST_MAP = "displacement_sd.nii.gz", "trust.nii.gz"
SCRIPT = "load_in_slicer.py"
SURFACES = ("surface-before.vtu", "surface-after.vtu")
#: Red, green and blue of what `trust.nii.gz` says.
_COLOURS = {SEEN: (0.0, 0.62, 0.45), UNSEEN: (0.6, 0.6, 0.6), LEFT: (0.84, 0.37, 0.0)}
#: Edges of voxels, and how far they reach beyond the body, where there is no image [mm].
_SPACING, _MARGIN = 2.0, 40.0
#: Of a voxel of the transforms [mm], at most: between the centres of larger ones the inverse is off by more than 0.05
#: mm, and smaller ones cost memory and time.
_EDGE = 1.0
#: Voxels of the transforms, at most: these take about 4 GB. Of a larger box the voxels are larger.
_MOST_VOXELS = 64_000_000
#: Part of the body that may lie outside an image before the image is none of it.
_INSIDE = 0.5
#: Part of the body outside an image from which on it is said.
_CUT_OFF = 0.001
#: From which on it is said that a point and the transform of the voxels disagree [mm].
_APART = 0.05


@dataclass(frozen=True, eq=False)
class WarpRequest:
    """What is to be warped, read and checked before anything is computed."""

    image: Image | None
    labels: Image | None
    points: tuple[PointFile, ...]

    @property
    def images(self) -> list[Image]:
        """Those that there are."""
        return [each for each in (self.image, self.labels) if each is not None]

    @property
    def grid_of(self) -> Image | None:
        """The image whose grid is that of the files."""
        return self.labels if self.image is None else self.image


def read_request(image: Path | None, labels: Path | None, points: Sequence[Path]) -> WarpRequest:
    """Read what is to be warped. `InputError`, naming the file, what was found and what was expected."""
    require("nibabel", "writing of images")
    request = WarpRequest(
        None if image is None else read_image(image),
        None if labels is None else read_image(labels),
        tuple(read_point_file(path) for path in points),
    )
    if request.labels is not None:
        labels_of(request.labels)
    if request.image is not None and request.image.values.dtype.kind not in "iufb":
        kind = request.image.values.dtype
        raise InputError(f"{request.image.path}: expected real numbers, found values of type {kind}")
    if request.grid_of is not None and request.grid_of.grid.is_skew:
        raise InputError(
            f"{request.grid_of.path}: affine: its axes are not at right angles, which no ITK transform can have: "
            "resample the image first"
        )
    names = _names(request)
    # one file on systems that take letters for the same in either case
    plain = [name.lower() for name in names]
    for name in names:
        if (times := plain.count(name.lower())) > 1:
            raise InputError(f"{name}: {times} of the files given would be written as it: rename one")
    return request


def write_warped(
    folder: Path,
    state: SavedState,
    request: WarpRequest,
    progress: Callable[[float, str], None] = lambda share, stage: None,
) -> tuple[list[str], list[str]]:
    """Write all that a state and what is asked for, which is of its body (`check_place`), give; returns what a user
    should read, and names of the files."""
    source = request.grid_of
    grid = Grid.around(state.mesh, _SPACING, _MARGIN) if source is None else source.grid
    progress(0.0, "displacement on the grid of the image")
    fine = _for_transforms(grid)
    inside = voxels_inside(state.mesh, fine)
    field = displacement_field(inside, state.u, state.middles)
    progress(0.3, "its inverse")
    back = inverse(field, inside.mask)
    progress(0.8, "files")
    write_displacement(folder / "displacement.nii.gz", field.on(grid))
    write_transform(folder / FORTH, back.field)
    write_transform(folder / BACK, field)
    files = ["displacement.nii.gz", FORTH, BACK]
    onto = back.field.on(grid)
    for image, nearest in ((request.image, False), (request.labels, True)):
        if image is not None:
            name = _after(image.path)
            write_volume(folder / name, resampled(image.values, image.grid, onto, nearest=nearest), grid)
            files.append(name)
    files += _write_maps(folder, state, inside if fine is grid else voxels_inside(state.mesh, grid))
    moved = [move_points(file, state.mesh, state.u, state.middles, field) for file in request.points]
    if moved:
        files += write_moved(folder, moved)
    files += _write_slicer_scene(folder, state, request, files)
    shown = _shown(request, state, field, inside)
    return lines("warped.txt", "warped", request, state, shown, field.grid, back, moved, LENGTH, _APART), files


def in_the_way(folder: Path, request: WarpRequest) -> list[str]:
    """Names of files in a folder that what is asked for would be written over."""
    names = ["displacement.nii.gz", FORTH, BACK, *_names(request)]
    return [name for name in names if (folder / name).exists()]


def _names(request: WarpRequest) -> list[str]:
    return [*(_after(image.path) for image in request.images), *(file.moved_name for file in request.points)]


def _after(path: Path) -> str:
    stem = path.name
    for ending in (".gz", ".nii", ".mgz", ".mgh", ".nrrd", ".nhdr", ".mha", ".mhd", ".img", ".hdr"):
        if stem.lower().endswith(ending):
            stem = stem[: -len(ending)]
    return f"{stem}-after.nii.gz"


def check_place(request: WarpRequest, mesh: TetMesh, path: Path) -> None:
    """`InputError` if most of a body is outside of an image: in another place, unit or orientation."""
    points = MILLIMETRES * mesh.points
    for image in request.images:
        if (edge := float(image.grid.voxel.max())) > np.ptp(points, axis=0).max():
            raise InputError(
                f"{image.path}: a voxel of {edge:.4g} mm is larger than the body of {path}: what is its unit?"
            )
        share = float(np.mean(image.grid.contains(points)))
        if share < _INSIDE:
            # all eight: of an oblique image two opposite ones span less than the image
            corners = image.grid.positions(np.indices((2, 2, 2)).reshape(3, -1).T * (np.array(image.grid.shape) - 1))
            raise InputError(
                f"{image.path}: affine: {100 * share:.0f} % of the body of {path} are in it: it spans "
                f"{_span(corners)}, the body {_span(points)} mm RAS: is it the image that the mesh was made from?"
            )
    if request.labels is not None:
        there = request.labels.values != 0
        labelled = [np.flatnonzero(there.any(axis=across)) for across in ((1, 2), (0, 2), (0, 1))]
        if not len(labelled[0]):
            raise InputError(f"{request.labels.path}: all its voxels are 0: there are no labels to warp")
        ends = np.array([(index.min() - 0.5, index.max() + 0.5) for index in labelled])
        indices = request.labels.grid.indices(points)
        if (ends[:, 1] < indices.min(axis=0)).any() or (ends[:, 0] > indices.max(axis=0)).any():
            box = request.labels.grid.positions(np.array(np.meshgrid(*ends, indexing="ij")).reshape(3, -1).T)
            raise InputError(
                f"{request.labels.path}: affine: its labels span {_span(box)}, the body of {path} {_span(points)} "
                "mm RAS: no label is of it"
            )


def _span(points: Floats) -> str:
    """The box (n, 3) points are in, as text."""
    ends = zip(points.min(axis=0), points.max(axis=0), strict=True)
    return " x ".join(f"{low:.0f} to {high:.0f}" for low, high in ends)


def _for_transforms(grid: Grid) -> Grid:
    """The box of an image in voxels that a transform needs, or the smallest that fit the memory."""
    edge = _EDGE
    while (fine := grid.with_edges(edge)).count > _MOST_VOXELS:
        edge *= 1.25
    return fine


def _write_maps(folder: Path, state: SavedState, inside: VoxelsInside) -> list[str]:
    """`displacement_sd.nii.gz` and `trust.nii.gz`, where the result knows them."""
    files = []
    if state.deviation is not None:
        deviation = MILLIMETRES * inside.interpolate(state.deviation[:, None])[:, 0]
        write_volume(folder / DEVIATION, inside.image(deviation), inside.grid)
        files.append(DEVIATION)
    if state.trust is not None:
        nearest = state.mesh.tetrahedra[inside.elements, inside.weights.argmax(axis=1)]
        write_volume(folder / TRUST_MAP, inside.image(state.trust[nearest]).astype(np.uint8), inside.grid)
        files.append(TRUST_MAP)
    return files


def _shown(
    request: WarpRequest, state: SavedState, field: DisplacementField, inside: VoxelsInside
) -> dict[str, float | bool | dict[str, float]]:
    """Numbers that are printed: the largest displacement [mm], parts of the body [%] outside of each image and of each
    trust, and whether something is left."""
    points, volumes = MILLIMETRES * state.mesh.points, state.mesh.node_volumes

    def share(nodes: Bools) -> float:
        return 100.0 * float(volumes[nodes].sum() / volumes.sum())

    outside = {image.path.name: share(~image.grid.contains(points)) for image in request.images}
    trust = state.trust
    return {
        "largest": float(np.linalg.norm(field.vectors[inside.mask], axis=1).max(initial=0.0)),
        "outside": {name: part for name, part in outside.items() if part > 100.0 * _CUT_OFF},
        "trust": {} if trust is None else {TRUST[value]: share(trust == value) for value in TRUST},
        "left": trust is not None and bool((trust == LEFT).any()),
    }


def _write_slicer_scene(folder: Path, state: SavedState, request: WarpRequest, files: Sequence[str]) -> list[str]:
    """Write the surfaces before and after, and a script for Slicer's Python console that loads all with colours, beside
    the files that are there already; returns the names of those added."""
    import meshio

    size = MILLIMETRES * np.linalg.norm(state.u, axis=1)
    faces = state.mesh.boundary
    nodes, numbers = np.unique(faces, return_inverse=True)
    for name, moved in zip(SURFACES, (0.0, 1.0), strict=True):
        corners, triangles = MILLIMETRES * (state.mesh.points + moved * state.u)[nodes], numbers.reshape(-1, 3)
        sizes = {"displacement_size": size[nodes]}
        write_body(folder / name, meshio.Mesh(corners, [("triangle", triangles)], point_data=sizes))
    image, labels = request.image, request.labels
    volumes = [] if image is None else [image.path.resolve().as_posix(), _after(image.path)]
    markups = [file for file in request.points if not is_electrodes(file.path)]
    meanings = [[value, meaning, *_COLOURS[value]] for value, meaning in TRUST.items()]
    values = {
        "folder": folder.resolve().as_posix(),
        "volumes": [name for name in volumes if not name.lower().endswith((".mgz", ".mgh"))],
        "labels": [] if labels is None else [_after(labels.path)],
        "deviation": [name for name in files if name == DEVIATION],
        "trust": [[name, meanings] for name in files if name == TRUST_MAP],
        "surfaces": [[SURFACES[0], 0.3], [SURFACES[1], 1.0]],
        "markups": [[file.path.resolve().as_posix(), file.moved_name] for file in markups],
        "electrodes": [file.path.name for file in request.points if is_electrodes(file.path)],
        "transform": FORTH,
        "largest": max(float(size.max()), 1e-6),
    }
    path = (folder / SCRIPT).resolve().as_posix()
    script = rendered("load_in_slicer.txt", path=path, **{name: json.dumps(value) for name, value in values.items()})
    write_text(folder / SCRIPT, script + "\n")
    return [*SURFACES, SCRIPT]
