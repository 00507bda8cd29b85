"""What all recordings have and do, and how well they are registered; a file for each kind says the rest: keys, data,
reading, writing, checks."""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from warpbrain.arrays import Floats, Int32s
from warpbrain.atomic import whole_file
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.keys import Key
from warpbrain.mesh import TetMesh
from warpbrain.mesh.vtu import write_vtu
from warpbrain.problems import Problems
from warpbrain.recordings.text import collected

#: Columns of a file by name: numbers (n,) or words; of the names of several columns numbers (n, k). None is left out.
Columns = dict[str | tuple[str, ...], Floats | tuple[str, ...] | None]
#: Fields of a recording by name, in SI units and RAS axes, and how many SI units one of the file's is, in which `sigma`
#: is.
Content = tuple[dict[str, Any], float]

POSITION = ("x", "y", "z")
DISPLACEMENT = ("ux", "uy", "uz")
REFERENCE = Key(
    "reference",
    "number",
    "Time of the loaded state from which displacements and forces are counted; the body at rest if absent.",
    "s",
    above=0.0,
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Recording:
    """What all recordings have; `warpbrain.recordings.recording.RECORDINGS` has the kinds."""

    kind: ClassVar[str]
    #: What `case.toml` says of this kind besides name, file, role and sigma.
    keys: ClassVar[tuple[Key, ...]]
    #: Whether it belongs to a laboratory specimen and not to a body.
    of_specimen: ClassVar[bool] = False
    name: str
    file: str  # it came from, relative to the case folder
    role: str = "fit"  # "fit" or "check", which is never fitted, only scored
    #: Noise of one component, one standard deviation, in the unit of what was recorded (m, N, Pa or N m); None: to be
    #: estimated.
    sigma: float | None = None
    #: Time [s] of the loaded state from which displacements and forces are counted; None: rest.
    reference: float | None = None
    time: Floats | None = None  # (n,) [s], increasing

    @classmethod
    def read(
        cls, path: Path, frame: Frame, problems: Problems, *, sigma: float | None = None, **given: Any
    ) -> Self | None:
        """Read a file.

        `frame`: unit and axes of the file, unless it states its own.
        `problems`: gets everything that is wrong with the file.
        `name`, `file`, `role`: as in `Recording`.
        `sigma`: as `case.toml` has it: noise of one component in the unit of the file.
        `**given`: the `keys` of the kind in SI units and RAS axes, None where `case.toml` says nothing; of a key that
        names a file its path, with the text as `KEY_file`.

        Returns None if there were problems.
        """
        with collected(path, problems) as of_file:
            values, unit = cls._read(path, frame, of_file, given)
        if of_file:
            return None
        return cls(sigma=None if sigma is None else unit * sigma, **given, **values)

    @classmethod
    def _read(cls, path: Path, frame: Frame, problems: Problems, given: dict[str, Any]) -> Content:
        """What a file holds, or `Unreadable`; what is no field is taken out of `given`."""
        raise NotImplementedError

    @classmethod
    def fault_of_keys(cls, given: Mapping[str, Any]) -> tuple[str, str] | None:
        """A key that cannot have its value whatever the file holds, and why; None if there is none."""
        return None

    @property
    def count(self) -> int:
        """How many rows, points or instants it has."""
        raise NotImplementedError

    @property
    def components(self) -> int:
        """How many numbers a row holds."""
        return 1

    @property
    def noise_unit(self) -> str:
        """Unit of `sigma`."""
        return "m"

    @property
    def content(self) -> str:
        """What it holds, for people to read."""
        raise NotImplementedError

    def in_case(self) -> Mapping[str, Any]:
        """Values of the keys of `case.toml`, in SI units and RAS axes."""
        return vars(self)

    def without_meaning(self) -> Mapping[str, tuple[str, str]]:
        """Keys that mean nothing for what the file holds, why, and what they would say of other files."""
        return {}

    def check(self, mesh: TetMesh, path: Path, problems: Problems) -> None:
        """Note as problems what cannot have been recorded of a body (its mesh at rest, without what was resected).

        `InputError` if the mesh has nothing that it could have been recorded of.
        """

    @property
    def ending(self) -> str:
        """Of the file that `write` writes."""
        return ".csv"

    def columns(self, frame: Frame) -> Columns:
        """Columns of a table that `read` gives back."""
        raise NotImplementedError

    def write(self, path: Path, frame: Frame) -> None:
        """Write a file that reading gives back, whole or not at all.

        Numbers are written with all their digits: in metres reading gives the same ones back, in mm the same to
        rounding. What stands in `case.toml` (name, role, sigma, node set, boundary, mode) is not in the file.

        `frame`: unit and axes of the file. `InputError` if the ending is not that of such a recording, or the file
        cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() != self.ending:
            recording = f"the {self.kind} recording '{self.name}'"
            raise InputError(f"{path}: {recording} is written as {self.ending}, found '{path.suffix}'")
        self._write(path, frame)

    def _write(self, path: Path, frame: Frame) -> None:
        write_columns(path, self.columns(frame))


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackedPoints:
    """What a file tells of tracked points: where each was and how far it went."""

    #: (n, 3) [m], RAS.
    points: Floats
    displacement: Floats
    time: Floats | None = None  # (n,) [s]
    ids: tuple[str, ...] | None = None
    #: (n,), noise of one component of each point [m]; takes precedence over that of the recording.
    sigmas: Floats | None = None
    weights: Floats | None = None  # (n,)


@dataclass(frozen=True)
class Registration:
    """How far a registration may be wrong: one standard deviation each, normal.

    `InputError` if one is not a positive number.
    """

    shift: float  # of each component of a shift [m]
    turn: float  # of each component of a rotation vector [rad]

    def __post_init__(self) -> None:
        for name, value in (("shift", self.shift), ("turn", self.turn)):
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"registration: {name} = {value}: expected a positive number")

    @property
    def deviations(self) -> Floats:
        """Standard deviations of the six numbers, shape (6,)."""
        return np.repeat([self.shift, self.turn], 3)


def write_columns(path: Path, columns: Columns) -> None:
    """Write a table that `warpbrain.recordings.tables.read_table` gives back, numbers with all their digits."""
    table: dict[str, Sequence[Any]] = {}
    for name, values in columns.items():
        if isinstance(name, tuple) and values is not None:
            table |= zip(name, np.transpose(values).tolist(), strict=True)
        elif isinstance(name, str) and values is not None:
            table[name] = values if isinstance(values, tuple) else values.tolist()
    with whole_file(path) as scratch, scratch.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(table) + "\n")
        csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_NONNUMERIC).writerows(zip(*table.values(), strict=True))


def write_triangles(path: Path, points: Floats, faces: Int32s, frame: Frame) -> None:
    """Write a surface with points (n, 3) [m, RAS] and triangles (k, 3) as VTU."""
    import meshio

    with whole_file(path) as scratch:
        write_vtu(scratch, meshio.Mesh(frame.file_lengths(points), [("triangle", faces)]), frame.axes)
