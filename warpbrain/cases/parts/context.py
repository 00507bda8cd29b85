"""What the reading of every part of a case shares."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from warpbrain.cases.format.keys import Table
from warpbrain.cases.format.parsing import file_of
from warpbrain.cases.format.table import Reading
from warpbrain.frame import Frame
from warpbrain.mesh import TetMesh
from warpbrain.problems import Problems
from warpbrain.values import short


@dataclass
class Context:
    """Where a case is being read from, and what was found wrong so far.

    Attributes
    ----------
    file : Path
        The `case.toml`.
    tables : dict
        Its top level.
    problems : Problems
    frame : Frame
        Of every file in the folder.
    mesh : TetMesh or None
        The whole anatomy; None if it could not be read.
    """

    file: Path
    tables: dict[str, Any]
    problems: Problems
    frame: Frame = field(default_factory=Frame)
    mesh: TetMesh | None = None

    @property
    def folder(self) -> Path:
        """The case folder."""
        return self.file.parent

    def table(self, table: Table, needed: bool = True) -> Reading:
        """Read ``[name]``; one that may be left out is read as an empty table."""
        if needed and table.name not in self.tables:
            keys = ", ".join(key.name for key in table.keys_of(table.default).values() if key.needed)
            self.problems.add(self.file, f"[{table.name}]", "missing", f"a table with {keys}")
            return Reading(Table(table.name, table.doc), {}, self.file, table.name, Problems())
        return Reading(table, self.tables.get(table.name, {}), self.file, table.name, self.problems)

    def lists(self, table: Table) -> list[Reading]:
        """Read every ``[[name]]``."""
        values = self.tables.get(table.name, [])
        if not isinstance(values, list):
            self.problems.add(
                self.file, f"[[{table.name}]]", f"expected a list of tables, found {short(values)}", "two brackets"
            )
            return []
        return [
            Reading(table, value, self.file, f"{table.name} {number}", self.problems)
            for number, value in enumerate(values, 1)
        ]

    def path(self, reading: Reading, key: str) -> Path | None:
        """The file of the folder that a key names; None, and a problem noted, if there is no such file."""
        if not reading.has(key):
            return None
        path, fault = file_of(self.folder, reading.get(key))
        if fault:
            reading.problem(key, fault)
        return path
