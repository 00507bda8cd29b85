"""Reads `case.toml`: its bytes into tables, each against what it may say, and the files of its folder that it names."""

import itertools
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from warpbrain.frame import Frame
from warpbrain.keys import Table, short
from warpbrain.mesh import TetMesh
from warpbrain.problems import Problems, nearest

#: No case.toml is as large as this [bytes]; a file that is must be something else.
LARGEST_TOML = 4 << 20


def parse_toml(file: Path, problems: Problems) -> dict[str, Any] | None:
    """The tables of a file; None if it cannot be read, which is then a problem."""
    try:
        size = file.stat().st_size
        if file.is_file() and size > LARGEST_TOML:
            problems.add(file, "", f"found {size / 1e6:.0f} MB, expected a text of at most {LARGEST_TOML / 1e6:.0f} MB")
            return None
        content = file.read_bytes()
        if not content.strip():
            problems.add(file, "", "the file is empty", "`warpbrain cases new` writes one to start from")
            return None
        # some editors begin UTF-8 text with a byte order mark
        return tomllib.loads(content.decode("utf-8").lstrip("\ufeff"))
    except FileNotFoundError:
        problems.add(file, "", "no such file")
    except OSError as error:
        problems.add(file, "", f"cannot be read: {error.strerror}")
    except UnicodeDecodeError as error:
        problems.add(file, "", f"not UTF-8 text (byte {error.start})", "save it as UTF-8")
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, thousands of brackets
        problems.add(file, "", f"not valid TOML: {error}")
    return None


class Reading:
    """A table of a file: the values that are right, with every fault noted as a problem.

    `table`: what it may say.
    `values`: what the file has there.
    `where`: how a message calls it: ``"tissue.1"``, ``"boundary 2"``.
    """

    def __init__(self, table: Table, values: Any, context: "Context", where: str) -> None:
        self.context, self.where = context, where
        self._good: dict[str, Any] = {}
        self._named: set[str] = set(values) if isinstance(values, dict) else set()
        #: Which of the table's variants it is; None if that cannot be told.
        self.variant: str | None = None
        self.keys = table.keys_of("")
        if not isinstance(values, dict):
            context.problem(f"[{where}]", f"expected a table, found {short(values)}")
            return
        if table.by is None:
            self.variant = ""
        else:
            chosen = values.get(table.by.name, table.by.default)
            if isinstance(chosen, str) and chosen in table.by.choices:
                self.variant = chosen
        self.keys = table.keys_of(self.variant or "")
        for name, value in values.items():
            if name not in self.keys:
                if name not in table.all_keys():
                    self.problem(name, "unknown key", nearest(name, self.keys))
                elif table.by is not None and self.variant is not None:  # else it is not known what it belongs to
                    takes = ", ".join(key.name for key in table.variants[self.variant]) or "no key of its own"
                    self.problem(name, f"means nothing with {table.by.name} '{self.variant}'", f"it takes {takes}")
            elif fault := self.keys[name].fault(value):
                # a unit or axes that look alike are others all the same
                guess = isinstance(value, str) and name not in ("units", "axes")
                choices = self.keys[name].choices if guess else ()
                self.problem(name, fault, nearest(value, choices, self.keys[name].hint))
            else:
                self._good[name] = value
        for name, key in self.keys.items():
            if key.needed and name not in values:
                self.problem(name, "missing", key.hint or f"expected {key.expected()}")

    def problem(self, key: str, message: str, cure: str = "") -> None:
        """Note what is wrong with a key."""
        self.context.problem(f"[{self.where}] {key}", message, cure)

    def named(self, key: str) -> bool:
        """Whether the file has the key, right or wrong."""
        return key in self._named

    def has(self, key: str) -> bool:
        """Whether the key is there and right."""
        return key in self._good

    def wrong(self, key: str) -> bool:
        """Whether the key is there and not right."""
        return key in self._named and key not in self._good

    def get(self, key: str) -> Any:
        """The value of a key that is there and right as the file has it, else its default."""
        return self._good.get(key, self.keys[key].default if key in self.keys else None)

    def si(self, key: str) -> Any:
        """The same in SI units and RAS axes; None if there is none."""
        value = self.get(key)
        return None if value is None else self.keys[key].in_si(value, self.context.frame)

    def path(self, key: str) -> Path | None:
        """The file of the folder that a key names; None, and a problem noted, if there is no such file."""
        if not self.has(key):
            return None
        folder, name = self.context.file.parent, self.get(key)
        path: Path = folder / name
        try:
            if not path.resolve().is_relative_to(folder.resolve()):
                fault = f"'{name}' leaves the case folder"
            elif path.is_file():
                return path
            else:
                kind = "a folder" if path.is_dir() else "not a plain file"
                fault = f"no such file: {path}" + (f" is {kind}" if path.exists() else "")
        except (OSError, ValueError, RuntimeError) as error:  # a name too long, a link to itself
            fault = f"no such file: {path} ({error})"
        self.problem(key, fault)
        return None

    def ramp(self) -> tuple[tuple[float, float], ...] | None:
        """Pairs of time and factor, none if it says nothing; None if they are wrong."""
        if self.wrong("ramp"):
            return None
        ramp = tuple((float(t), float(f)) for t, f in self.get("ramp") or ())
        for (a, _), (b, _) in itertools.pairwise(ramp):
            if b <= a:
                self.problem("ramp", f"times must increase, found {b:g} s after {a:g} s")
                return None
        return ramp


@dataclass
class Context:
    """Where a case is being read from, and what was found wrong so far."""

    file: Path  # the `case.toml`
    tables: dict[str, Any]  # its top level
    problems: Problems
    frame: Frame = field(default_factory=Frame)  # of every file in the folder
    mesh: TetMesh | None = None  # the whole anatomy; None if it could not be read

    def problem(self, place: str, message: str, cure: str = "") -> None:
        """Note what is wrong at a place of the `case.toml`."""
        self.problems.add(self.file, place, message, cure)

    def table(self, table: Table, needed: bool = True) -> Reading:
        """Read ``[name]``; one that may be left out is read as an empty table."""
        context = self
        if needed and table.name not in self.tables:
            keys = ", ".join(key.name for key in table.keys if key.needed)
            self.problem(f"[{table.name}]", "missing", f"a table with {keys}")
            context = replace(self, problems=Problems())  # that its keys are missing, too, goes without saying
        return Reading(table, self.tables.get(table.name, {}), context, table.name)

    def lists(self, table: Table) -> list[Reading]:
        """Read every ``[[name]]``."""
        values = self.tables.get(table.name, [])
        if not isinstance(values, list):
            message = f"expected a list of tables, found {short(values)}"
            self.problem(f"[[{table.name}]]", message, "two brackets")
            return []
        return [Reading(table, value, self, f"{table.name} {number}") for number, value in enumerate(values, 1)]
