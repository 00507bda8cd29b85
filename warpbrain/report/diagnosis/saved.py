"""What the folder of a diagnosis holds, opened again: the page of a report is made from these files alone."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.mesh.vtu import read_vtu
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.state_files import SavedState, read_state

#: States of a case in the order in which they are shown, and their names for people.
STATES = {"declared": "as declared", "refitted": "tissue refitted", "explained": "with what is named"}


@dataclass(frozen=True, eq=False)
class Anatomy:
    """The mesh of `map.vtu` and what is known at its nodes.

    Attributes
    ----------
    mesh : TetMesh
        Without sets.
    fields : dict of str to array
        As `write_map` says.
    """

    mesh: TetMesh
    fields: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Vectors:
    """Points that were recorded, each with what is left of it: of a surface the part along its normal.

    Attributes
    ----------
    where : (k, 3) array
        [m]
    left : dict of str to (k, 3) array
        What was observed less what was computed [m], by state.
    aside : (k,) bool array
        Set aside as gross errors.
    """

    where: Floats
    left: dict[str, Floats]
    aside: Bools


@dataclass(frozen=True, eq=False)
class Rows:
    """Numbers that were recorded: columns of `points.csv` or `curves.csv`.

    Attributes
    ----------
    columns : dict of str to array
        Numbers, NaN where the file has none; texts of what holds words.
    """

    columns: dict[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.columns[name]

    def has(self, name: str) -> bool:
        """Whether there is a column that holds a number."""
        return name in self.columns and not np.isnan(self.columns[name]).all()

    @cached_property
    def lengths(self) -> Bools:
        """Which rows are of displacements."""
        return np.asarray(self["unit"] == "mm")

    @cached_property
    def last(self) -> Bools:
        """Which rows are of the last time of each recording."""
        times = np.where(np.isnan(self["time_s"]), np.inf, self["time_s"])
        ends = {name: times[self["recording"] == name].max() for name in np.unique(self["recording"])}
        return np.asarray(times == [ends[name] for name in self["recording"]])

    @property
    def vectors(self) -> Vectors:
        """The points of the last time."""
        rows = self.lengths & self.last
        points, which = np.unique(self["point"][rows], return_inverse=True)
        first = np.unique(which, return_index=True)[1]
        where = np.column_stack([self[f"{axis}_mm"][rows][first] for axis in "xyz"]).reshape(-1, 3) / MILLIMETRES
        along = np.column_stack([self[f"direction_{axis}"][rows] for axis in "xyz"])
        left = {}
        for state in STATES:
            if self.has(state):
                found = np.zeros((len(points), 3))
                np.add.at(found, which, along * (self["observed"] - self[state])[rows][:, None] / MILLIMETRES)
                left[state] = found
        return Vectors(where, left, self["set_aside"][rows][first] > 0.0)


@dataclass(frozen=True)
class Unit:
    """How errors are shown.

    Attributes
    ----------
    name : str
    factor : float
        From what is saved.
    suffix : str
        Of the keys of `diagnosis.json`.
    error : str
        What of one recorded row is squared.
    """

    name: str
    factor: float
    suffix: str
    error: str


def unit_of(summary: Mapping[str, Any]) -> Unit:
    """That of the errors of a diagnosis."""
    if "rmse_m" in summary["fit"]:
        return Unit("mm", MILLIMETRES, "m", "distance in space")
    return Unit("Pa", 1.0, "pa", "error of the stress")


@dataclass(frozen=True, eq=False)
class Saved:
    """A diagnosis as it lies in its folder.

    Attributes
    ----------
    summary : dict
        `diagnosis.json`.
    anatomy : Anatomy or None
        None of a specimen.
    rows, curves : Rows or None
        What was recorded of a body, and of a specimen.
    state : SavedState or None
        The last state, as `state.vtu` has it.
    """

    summary: dict[str, Any]
    anatomy: Anatomy | None
    rows: Rows | None
    curves: Rows | None
    state: SavedState | None = None


def read_saved(folder: Path) -> Saved:
    """Open the files of a diagnosis.

    Raises
    ------
    InputError
        If there is no `diagnosis.json`, or it is not one.
    """
    path = folder / "diagnosis.json"
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise InputError(f"{path}: no JSON: {error}") from None
    if not (isinstance(summary, dict) and "verdict" in summary):
        raise InputError(f"{path}: verdict: missing: it is no diagnosis")
    return Saved(
        summary,
        _anatomy(folder / "map.vtu"),
        _rows(folder / "points.csv"),
        _rows(folder / "curves.csv"),
        read_state(folder / "state.vtu") if (folder / "state.vtu").is_file() else None,
    )


def _anatomy(path: Path) -> Anatomy | None:
    if not path.is_file():
        return None
    file = read_vtu(path)
    mesh = TetMesh(file.points / MILLIMETRES, file.cells[0].data, file.cell_data["tissue"][0], {}, {})
    return Anatomy(mesh, file.point_data)


def _rows(path: Path) -> Rows | None:
    if not path.is_file():
        return None
    with path.open(encoding="utf-8", newline="") as stream:
        table = list(csv.DictReader(stream))
    if not table:
        return None
    words = ("recording", "unit", "test", "mode", "role")
    columns: dict[str, Any] = {}
    for name in table[0]:
        texts = [row[name] for row in table]
        columns[name] = np.array(texts) if name in words else np.array([float(text or "nan") for text in texts])
    return Rows(columns)
