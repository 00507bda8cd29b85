"""A laboratory test on a specimen."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.frame import PASCALS, Frame
from warpbrain.keys import Key
from warpbrain.problems import Problems
from warpbrain.recordings.base import Columns, Content, Recording
from warpbrain.recordings.tables import Table, read_csv

#: What a test of each mode may have recorded: imposed, response.
QUANTITIES = {
    "axial": (("displacement", "force"), ("stretch", "stress")),
    "shear": (("displacement", "force"),),
    "torsion": (("angle", "torque"),),
    "confined": (("displacement", "force"), ("stretch", "stress")),
    "biaxial": (("stretch", "stress"),),
}
UNITS = {"displacement": "m", "force": "N", "stress": "Pa", "angle": "rad", "torque": "N m", "stretch": "1"}
#: Axis of the machine.
Z = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class TestRecording(Recording):
    """A laboratory test on a specimen: what was imposed and what it answered."""

    # not a test of pytest's
    __test__ = False
    kind: ClassVar[str] = "test"
    of_specimen: ClassVar[bool] = True
    keys: ClassVar[tuple[Key, ...]] = (
        Key("mode", "text", "How the specimen was loaded.", needed=True, choices=tuple(QUANTITIES)),
        Key(
            "stress",
            "text",
            "What the column stress is: force over the area at rest, or over that of an incompressible specimen",
            choices=("nominal", "cauchy"),
            default="nominal",
        ),
        Key("unit", "text", "Unit of the column stress", choices=tuple(PASCALS), default="Pa"),
        Key(
            "control",
            "text",
            "What the machine imposed, a displacement (stretch, angle) or a force (stress, torque); sigma is of "
            "the other",
            choices=("displacement", "force"),
            default="displacement",
        ),
        Key("specimen", "text", "Which one was tested, where tests are of several of one shape."),
        Key("axis", "vector", "Direction of the tissue along the machine's axis z; z if absent."),
        Key("sheared", "vector", "Direction of the tissue along the machine's x, in which it shears; x if absent."),
    )
    #: Confined: axial between lubricated walls that let it widen nowhere. Biaxial: stretched alike along x and y, its
    #: thickness along z free; its stress is along x.
    mode: str
    #: ``("displacement", "force")`` [m, N], ``("stretch", "stress")`` [1, Pa nominal] or ``("angle", "torque")``
    #: [rad, N m].
    quantities: tuple[str, str]
    imposed: Floats  # (n,)
    response: Floats  # (n,)
    specimen: str = ""  # which one was tested, where tests of a case are of several of one shape; empty: the one
    #: Directions of the tissue along the machine's axis z, and along its x, in which it shears; of any length but zero.
    #: Of `sheared` what is across the axis counts.
    axis: tuple[float, float, float] = Z
    sheared: tuple[float, float, float] | None = None
    control: str = "displacement"  # what the machine imposed, or "force"; `sigma` is of what answered

    @classmethod
    def _read(cls, path: Path, frame: Frame, problems: Problems, given: dict[str, Any]) -> Content:
        """Read ``.csv``: columns of one pair of `QUANTITIES` of the mode, and perhaps ``t`` [s].

        They are ``displacement`` (in the unit of `frame`) and ``force`` [N], ``stretch`` and ``stress``, or ``angle``
        [rad] and ``torque`` [N m]; `unit` is that of a stress, of `PASCALS`, and `stress` what it is, see
        `nominal_stress`. `sigma` is of what answered, in the unit of its column.
        """
        mode, control = given["mode"], given.setdefault("control", "displacement")
        stress, unit = given.pop("stress", "nominal"), given.pop("unit", "Pa")
        # what is so if a key is absent
        given |= {"specimen": given.get("specimen") or "", "axis": given.get("axis") or Z}
        table = read_csv(path, problems, ("t", *(column for pair in QUANTITIES[mode] for column in pair)))
        pair = _pair(table, mode, problems)
        time = table.times(strictly=True) if "t" in table else None
        if pair[0] == "stretch":
            imposed = table.bounded("stretch", 0.0, itself=False)
        else:
            imposed = table.numbers(pair[0]) * (frame.metres if pair[0] == "displacement" else 1.0)
        response = table.numbers(pair[1])
        if pair[1] == "stress":
            response = PASCALS[unit] * nominal_stress(mode, imposed, response, stress)
        of_answer = {"stress": PASCALS[unit], "displacement": frame.metres}.get(pair[control != "force"], 1.0)
        return {"quantities": pair, "imposed": imposed, "response": response, "time": time}, of_answer

    @classmethod
    def fault_of_keys(cls, given: Mapping[str, Any]) -> tuple[str, str] | None:
        try:
            turn_of(given["axis"] or Z, given["sheared"])
        except InputError as error:
            return "axis" if given["sheared"] is None else "sheared", str(error)
        return None

    @property
    def force_controlled(self) -> bool:
        """Whether the machine imposed the force: `response` is what was imposed then, and `imposed` what answered."""
        return self.control == "force"

    @property
    def controlled(self) -> tuple[str, Floats]:
        """What the machine imposed: its quantity, and the values (n,)."""
        return (self.quantities[1], self.response) if self.force_controlled else (self.quantities[0], self.imposed)

    @property
    def answer(self) -> tuple[str, Floats]:
        """What the specimen answered with: its quantity, and the values (n,)."""
        return (self.quantities[0], self.imposed) if self.force_controlled else (self.quantities[1], self.response)

    @property
    def turn(self) -> Floats:
        """Rotation (3, 3) from directions of the tissue to those of the machine; raises as `turn_of`."""
        return turn_of(self.axis, self.sheared)

    @property
    def count(self) -> int:
        return len(self.response)

    @property
    def noise_unit(self) -> str:
        return UNITS[self.answer[0]]

    @property
    def content(self) -> str:
        return f"{self.count} rows of a test in {self.mode}: {' and '.join(self.quantities)}"

    def in_case(self) -> Mapping[str, Any]:
        # a stress is written as a nominal one in Pa, and what is so if a key is absent is left out
        absent = {"specimen": "", "control": "displacement", "axis": Z}
        return {key: value for key, value in vars(self).items() if key not in absent or value != absent[key]}

    def without_meaning(self) -> Mapping[str, tuple[str, str]]:
        if self.quantities[1] == "stress":
            return {}
        why = f"means nothing of {' and '.join(self.quantities)}"
        return dict.fromkeys(("stress", "unit"), (why, "it says what a column stress is"))

    def columns(self, frame: Frame) -> Columns:
        imposed, response = self.quantities
        unit = frame.metres if imposed == "displacement" else 1.0
        return {"t": self.time, imposed: self.imposed / unit, response: self.response}


def nominal_stress(mode: str, stretch: Floats, values: Floats, kind: str) -> Floats:
    """Force over the area at rest of a stress that a test reports.

    A Cauchy stress is a force over the area at that stretch: of an incompressible specimen, as evaluations of tests
    take it, that at rest over the stretch, so that `P = sigma / lambda`. Between the walls of a confining chamber the
    area stays.
    """
    if kind == "nominal" or mode == "confined":
        return values
    return np.asarray(values / stretch)


def _pair(table: Table, mode: str, problems: Problems) -> tuple[str, str]:
    """The pair of quantities that was recorded."""
    known = QUANTITIES[mode]
    complete = [pair for pair in known if all(column in table for column in pair)]
    if len(complete) == 1:
        return complete[0]
    if complete:
        names = " and ".join(" with ".join(pair) for pair in complete)
        problems.refuse(table.path, "header", f"found {names}, expected one pair", "leave out or rename the other")
    nearest = max(known, key=lambda pair: sum(column in table for column in pair))
    table.require(*nearest)
    return nearest


def turn_of(axis: tuple[float, float, float], sheared: tuple[float, float, float] | None) -> Floats:
    """Rotation `R` (3, 3) of a tissue in a machine: `R axis` is along z, and `R sheared` between x and z.

    Without `sheared` the machine's x is what of the tissue's is across the axis, or of its y where that is little.

    `InputError` if one of them is zero, or they are one direction.
    """
    z = np.array(axis, dtype=np.float64)
    if not np.linalg.norm(z) > 0.0:
        raise InputError("expected 3 numbers that are not all zero")
    z = z / np.linalg.norm(z)
    x = np.eye(3)[int(abs(z[0]) > 0.9)] if sheared is None else np.array(sheared, dtype=np.float64)
    across = x - (x @ z) * z
    if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(x):
        raise InputError("expected a direction that is not along the axis")
    across = across / np.linalg.norm(across)
    return np.stack([across, np.cross(z, across), z])
