"""Tracked points of a body."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.keys import Key
from warpbrain.mesh import TetMesh
from warpbrain.physics.words import length
from warpbrain.problems import Problems
from warpbrain.recordings.base import DISPLACEMENT, POSITION, REFERENCE, Columns, Content, Recording, TrackedPoints
from warpbrain.recordings.inside import check_points_inside, check_possible
from warpbrain.recordings.tracked_points import tracked_points


@dataclass(frozen=True, eq=False, kw_only=True)
class PointsRecording(TrackedPoints, Recording):
    """Tracked points of a case."""

    kind: ClassVar[str] = "points"
    keys: ClassVar[tuple[Key, ...]] = (
        Key("moved", "file", "Where the points went, if the file is a Slicer markup."),
        Key(
            "outside",
            "text",
            "What a point outside the mesh is: an error, or observed at the nearest point",
            choices=("error", "nearest"),
            default="error",
        ),
        REFERENCE,
    )
    #: What a point farther outside the mesh than a local edge is: a mistake, or observed at the nearest point of it:
    #: "error" or "nearest".
    outside: str = "error"
    #: Where the second positions came from, if start and end are files of their own (Slicer markups).
    moved_file: str | None = None

    @classmethod
    def _read(cls, path: Path, frame: Frame, problems: Problems, given: dict[str, Any]) -> Content:
        """Read ``.csv``, ``.tag``, a pair of 3D Slicer markups (``.mrk.json``, ``.fcsv``), or an ending that another
        package reads (`warpbrain.recordings.tracked_points.Reader`).

        A CSV file has columns ``x,y,z``, ``ux,uy,uz`` and perhaps ``t`` [s], ``id``, ``sigma`` and ``weight``; ``.tag``
        and markups are in mm and in their own axes. `moved` is the markup with the same labels where the points have
        gone: needed if `path` is a markup, and refused if not.
        """
        return vars(tracked_points(path, frame, given.pop("moved", None), problems)), frame.metres

    @property
    def count(self) -> int:
        return len(self.points)

    @property
    def components(self) -> int:
        return 3

    @property
    def content(self) -> str:
        sizes = np.linalg.norm(self.displacement, axis=1)
        rms, most = length(float(np.sqrt(np.mean(sizes**2)))), length(float(sizes.max()))
        count = len(np.unique(self.points, axis=0))
        times = 0 if self.time is None else len(np.unique(self.time))
        points = f"{count} tracked point{'s' if count > 1 else ''}{f' at {times} times' if times > 1 else ''}"
        return f"{points}, moved by {rms} RMS, {most} at most"

    def check(self, mesh: TetMesh, path: Path, problems: Problems) -> None:
        check_possible(mesh, path, problems, [self.sigma, self.sigmas], self.displacement)
        if self.outside != "nearest":
            check_points_inside(self, mesh, path, problems)

    def columns(self, frame: Frame) -> Columns:
        if any(not name.strip() or "\n" in name or "\r" in name for name in self.ids or ()):
            raise InputError(f"recording '{self.name}': an id is empty or has a line break, and cannot be written")
        return {
            "id": self.ids,
            "t": self.time,
            POSITION: frame.file_lengths(self.points),
            DISPLACEMENT: frame.file_lengths(self.displacement),
            "sigma": None if self.sigmas is None else self.sigmas / frame.metres,
            "weight": self.weights,
        }


def distinct_rows(recording: PointsRecording, rows: Ints) -> tuple[Ints, Floats]:
    """Rows without copies of others, and their weights.

    A copy is of the same place and the same time, went as far, and has the same noise, to the last bit. Taken for rows
    of their own, two of half a weight would not be one: a gross error would have to strike each by itself, and what
    neighbours share grows with the noise of each.

    `rows` (k,): those to look at. Returns `rows` (m,): the first of each, in the order in which they were given;
    `weights` (m,): sums of the weights of each and its copies; rows without a weight have that of one.
    """
    weights = np.ones(len(rows)) if recording.weights is None else recording.weights[rows]
    columns_of = [recording.points, recording.displacement, recording.time, recording.sigmas]
    columns = np.column_stack([values[rows] for values in columns_of if values is not None])
    _, first, of = np.unique(columns, axis=0, return_index=True, return_inverse=True)
    total = np.bincount(of.ravel(), weights, minlength=len(first))
    order = np.argsort(first)
    return rows[first[order]], np.asarray(total[order], dtype=np.float64)
