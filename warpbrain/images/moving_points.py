"""Files of points with their points where tissue has carried them."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.atomic import write_csv, write_text
from warpbrain.errors import InputError
from warpbrain.images.displacement import DisplacementField
from warpbrain.images.grid import MILLIMETRES
from warpbrain.mesh import TetMesh
from warpbrain.mesh.quadratic import quadratic_interpolant
from warpbrain.problems import Problems, Unreadable
from warpbrain.recordings.electrodes import is_electrodes, read_electrodes
from warpbrain.recordings.location import locate
from warpbrain.recordings.markups import ENDINGS, Markup, is_markup, read_markup

_HEADER = (
    *("file", "label", "x_mm", "y_mm", "z_mm", "moved_x_mm", "moved_y_mm", "moved_z_mm"),
    *("displacement_mm", "outside_mm", "transform_apart_mm"),
)


@dataclass(frozen=True, eq=False)
class PointFile:
    """A file of points."""

    path: Path
    markup: Markup  # its points before
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
    before: Floats  # (n, 3) [mm, RAS]
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
        markup = read_electrodes(path, problems) if is_electrodes(path) else read_markup(path, problems)
    problems.stop()
    return PointFile(path, markup, tuple(problems.remarks))


def move_points(
    file: PointFile, mesh: TetMesh, u: Floats, middles: Floats | None, field: DisplacementField
) -> MovedPoints:
    """Move points along: inside the mesh as its elements do (`u` and `middles` as of `displacement_field`), outside as
    the field that continues it."""
    before = MILLIMETRES * file.markup.points
    place = locate(mesh.points, mesh.tetrahedra, file.markup.points)
    displacement = MILLIMETRES * place.interpolate(u)
    if middles is not None:
        # outside corners have another order: there the field takes over
        displacement = MILLIMETRES * quadratic_interpolant(place.weights, u[place.nodes], middles[place.element])
    outside, of_field = MILLIMETRES * place.distance, field.at(before)
    displacement[outside > 0.0] = of_field[outside > 0.0]
    apart = np.linalg.norm(displacement - of_field, axis=1)
    return MovedPoints(file, before, before + displacement, outside, ~field.grid.contains(before), apart)


def write_moved(folder: Path, moved: Sequence[MovedPoints]) -> list[str]:
    """Write each file with its points moved, and all of them in `moved.csv` [mm, RAS]; returns the names."""
    rows: list[Sequence[str]] = [_HEADER]
    for points in moved:
        markup = points.file.markup
        write_text(folder / points.file.moved_name, markup.moved_text(points.points / MILLIMETRES))
        sizes = np.linalg.norm(points.points - points.before, axis=1)
        numbers = np.column_stack([points.before, points.points, sizes, points.outside, points.apart])
        for label, values in zip(markup.labels, numbers.tolist(), strict=True):
            rows.append([points.file.path.name, label, *(f"{value:.4f}" for value in values)])
    write_csv(folder / "moved.csv", rows)
    return [*(points.file.moved_name for points in moved), "moved.csv"]
