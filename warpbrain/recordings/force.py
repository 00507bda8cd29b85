"""The resultant with which a boundary acts on a body."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.frame import Frame
from warpbrain.keys import Key
from warpbrain.problems import Problems
from warpbrain.recordings.base import REFERENCE, Columns, Content, Recording
from warpbrain.recordings.tables import read_csv

FORCE = ("fx", "fy", "fz")


@dataclass(frozen=True, eq=False, kw_only=True)
class ForceRecording(Recording):
    """The resultant with which a boundary acts on the tissue."""

    kind: ClassVar[str] = "force"
    keys: ClassVar[tuple[Key, ...]] = (
        Key("boundary", "text", "Name of the boundary that acts with it.", needed=True),
        REFERENCE,
    )
    boundary: str  # name of the boundary
    time: Floats  # (n,) [s], increasing
    force: Floats  # (n, 3) [N]; a component that was not recorded is NaN throughout
    torque: Floats | None = None  # (n,) [N m]

    @classmethod
    def _read(cls, path: Path, frame: Frame, problems: Problems, given: dict[str, Any]) -> Content:
        """Read ``.csv``: columns ``t`` [s] and one or more of ``fx``, ``fy``, ``fz`` [N] and ``torque`` [N m].

        `sigma` is of the force, or of the torque if that is all there is.
        """
        table = read_csv(path, problems, ("t", *FORCE, "torque"))
        recorded = [column for column in FORCE if column in table]
        if not recorded and "torque" not in table:
            table.has("fx")
        time = table.times(strictly=True) if table.has("t") else None
        force = np.full((len(table), 3), np.nan)
        for column in recorded:
            force[:, FORCE.index(column)] = table.numbers(column)
        torque = table.numbers("torque") if "torque" in table else None
        return {"time": time, "force": frame.directions(force), "torque": torque}, 1.0

    @property
    def count(self) -> int:
        return len(self.time)

    @property
    def components(self) -> int:
        return int(np.isfinite(self.force).all(axis=0).sum())

    @property
    def noise_unit(self) -> str:
        return "N"

    @property
    def content(self) -> str:
        return f"{self.count} forces on '{self.boundary}'"

    def columns(self, frame: Frame) -> Columns:
        force = zip(FORCE, frame.directions(self.force).T, strict=True)
        recorded: Columns = {name: values for name, values in force if np.isfinite(values).all()}
        return {"t": self.time, **recorded, "torque": self.torque}
