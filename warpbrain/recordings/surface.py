"""Points on a moved surface of a body, not paired with places of it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from warpbrain.arrays import Floats, Int32s
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.keys import Key
from warpbrain.mesh import TetMesh
from warpbrain.mesh.surface import unit
from warpbrain.problems import Problems
from warpbrain.recordings.base import POSITION, REFERENCE, Columns, Content, Recording, write_triangles
from warpbrain.recordings.inside import check_possible, check_surface_near
from warpbrain.recordings.markups import is_markup, read_markup
from warpbrain.recordings.surfaces import read_surface_mesh
from warpbrain.recordings.tables import Table, read_table

NORMAL = ("nx", "ny", "nz")


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceRecording(Recording):
    """Points on a moved surface, unpaired: compared with the moved faces of a node set."""

    kind: ClassVar[str] = "surface"
    keys: ClassVar[tuple[Key, ...]] = (
        Key("nodes", "text", "Node set whose faces are compared with it.", needed=True),
        REFERENCE,
    )
    points: Floats  # (n, 3) [m]
    nodes: str  # name of the node set whose faces are the surface
    normals: Floats | None = None  # (n, 3), unit normals
    faces: Int32s | None = None  # (k, 3), triangles, if a surface mesh was recorded

    @classmethod
    def _read(cls, path: Path, frame: Frame, problems: Problems, given: dict[str, Any]) -> Content:
        """Read ``.csv``, a 3D Slicer markup or a surface mesh.

        A CSV file has columns ``x,y,z`` and perhaps ``t`` [s] and ``nx,ny,nz``; of a mesh (``.vtp``, ``.stl``,
        ``.ply``, ``.obj``, ``.vtu``, ...) points and triangles are taken. Axes that a mesh states itself take
        precedence, and a markup is in mm and its own.
        """
        values: dict[str, Any]
        if path.suffix.lower() == ".csv":
            table = read_table(path, problems, (*POSITION, *NORMAL, "t"))
            table.require(*POSITION)
            values = {"points": frame.lengths(table.vectors(*POSITION)), "normals": _normals(table, frame)}
            values["time"] = table.times(strictly=False) if "t" in table else None
        elif is_markup(path):
            values = {"points": read_markup(path, problems).points}
        else:
            points, faces, axes = read_surface_mesh(path, problems)
            if axes not in (None, frame.axes):
                problems.remark(path, f"the file says that its axes are {axes}, which counts for it")
            values = {"points": Frame(frame.unit, axes or frame.axes).lengths(points), "faces": faces}
        return values, frame.metres

    @property
    def count(self) -> int:
        return len(self.points)

    @property
    def content(self) -> str:
        return f"{self.count} points of the moved surface '{self.nodes}', not paired"

    def check(self, mesh: TetMesh, path: Path, problems: Problems) -> None:
        check_possible(mesh, path, problems, [self.sigma])
        check_surface_near(self.points, mesh, self.nodes, f"recording '{self.name}'", path, problems)

    @property
    def ending(self) -> str:
        return ".csv" if self.faces is None else ".vtu"

    def columns(self, frame: Frame) -> Columns:
        normals = None if self.normals is None else frame.directions(self.normals)
        return {POSITION: frame.file_lengths(self.points), "t": self.time, NORMAL: normals}

    def _write(self, path: Path, frame: Frame) -> None:
        if self.faces is None:
            super()._write(path, frame)
            return
        if self.time is not None or self.normals is not None:
            raise InputError(f"{path}: a surface with triangles is written without times and normals; leave them out")
        write_triangles(path, self.points, self.faces, frame)


def _normals(table: Table, frame: Frame) -> Floats | None:
    """Unit normals (n, 3), RAS; all three columns or none of them."""
    if not any(column in table for column in NORMAL) or not table.has(*NORMAL):
        return None
    normals = frame.directions(table.vectors(*NORMAL))
    for index in np.flatnonzero(~normals.any(axis=1)):
        table.problem(int(index), "nx", "found a normal of length zero, expected a direction")
    return unit(normals)
