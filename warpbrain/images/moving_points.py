"""Files of points with their points where tissue has carried them."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.atomic import whole_file, write_text
from warpbrain.errors import InputError
from warpbrain.images.displacement import DisplacementField
from warpbrain.images.grid import MILLIMETRES
from warpbrain.mesh import TetMesh
from warpbrain.mesh.quadratic import quadratic_interpolant
from warpbrain.problems import Problems, Unreadable
from warpbrain.recordings.electrodes import is_electrodes, read_electrodes
from warpbrain.recordings.location import locate
from warpbrain.recordings.markups import ENDINGS, is_markup, read_markup

_HEADER = (
    *("file", "label", "x_mm", "y_mm", "z_mm", "moved_x_mm", "moved_y_mm", "moved_z_mm"),
    *("displacement_mm", "outside_mm", "transform_apart_mm"),
)


@dataclass(frozen=True, eq=False)
class PointFile:
    """A file of points."""

    path: Path
    labels: tuple[str, ...]
    points: Floats  # (n, 3), before [mm, RAS]
    moved_text: Callable[[Floats], str]  # from positions after (n, 3) [mm, RAS] to the text of the file that has them
    remarks: tuple[str, ...]

    @property
    def moved_name(self) -> str:
        """Name of the file with moved points."""
        name = self.path.name
        if is_electrodes(self.path):
            return f"{name[: -len('electrodes.tsv')]}desc-after_{name[-len('electrodes.tsv') :]}"
        ending = next(ending for ending in ENDINGS if name.lower().endswith(ending))
        return f"{name[: -len(ending)]}-after{name[-len(ending) :]}"


@dataclass(frozen=True, eq=False)
class MovedPoints:
    """Points of a file and where they have gone."""

    file: PointFile
    points: Floats  # (n, 3), after [mm, RAS]
    outside: Floats  # (n,), how far outside the mesh they were before [mm]
    beyond: Bools  # (n,), beyond the grid: they are taken not to move
    #: (n,), how far from here the field, and so the transform that is written, puts them [mm]: it is linear between the
    #: centres of voxels, and at a wall of tissue the displacement has a kink.
    apart: Floats


def read_point_file(path: Path) -> PointFile:
    """Read a 3D Slicer markup (`.mrk.json`, `.fcsv`) or a BIDS `electrodes.tsv`.

    `InputError`, naming the file, what was found and what was expected.
    """
    if not (is_electrodes(path) or is_markup(path)):
        raise InputError(f"{path}: found ending '{path.suffix}', expected .mrk.json, .fcsv or a BIDS electrodes.tsv")
    problems = Problems()
    with suppress(Unreadable):
        file = read_electrodes(path, problems) if is_electrodes(path) else read_markup(path, problems)
    problems.stop()
    moved_text = file.moved_text
    remarks = tuple(problems.remarks)
    return PointFile(
        path, file.labels, MILLIMETRES * file.points, lambda after: moved_text(after / MILLIMETRES), remarks
    )


def move_points(
    file: PointFile, mesh: TetMesh, u: Floats, middles: Floats | None, field: DisplacementField
) -> MovedPoints:
    """Move points along: inside the mesh as its elements do (`u` and `middles` as of `displacement_field`), outside as
    the field that continues it."""
    points = file.points / MILLIMETRES
    place = locate(mesh.points, mesh.tetrahedra, points)
    displacement = MILLIMETRES * place.interpolate(u)
    if middles is not None:
        # outside corners have another order: there the field takes over
        displacement = MILLIMETRES * quadratic_interpolant(place.weights, u[place.nodes], middles[place.element])
    outside, of_field = place.distance > 0.0, field.at(file.points)
    displacement[outside] = of_field[outside]
    return MovedPoints(
        file,
        file.points + displacement,
        MILLIMETRES * place.distance,
        ~field.grid.contains(file.points),
        np.linalg.norm(displacement - of_field, axis=1),
    )


def write_moved(folder: Path, moved: Sequence[MovedPoints]) -> list[str]:
    """Write each file with its points moved, and all of them in `moved.csv` [mm, RAS]; returns the names."""
    names = []
    for points in moved:
        name = points.file.moved_name
        text = points.file.moved_text(points.points)
        write_text(folder / name, text)
        names.append(name)
    with whole_file(folder / "moved.csv") as scratch, scratch.open("w", encoding="utf-8", newline="") as stream:
        rows = csv.writer(stream)
        rows.writerow(_HEADER)
        for points in moved:
            sizes = np.linalg.norm(points.points - points.file.points, axis=1)
            columns = (points.file.labels, points.file.points, points.points, sizes, points.outside, points.apart)
            for label, before, after, size, outside, apart in zip(*columns, strict=True):
                numbers = [f"{value:.4f}" for value in (*before, *after, size, outside, apart)]
                rows.writerow([points.file.path.name, label, *numbers])
    return [*names, "moved.csv"]
