"""Reads a `case.toml` and its mesh, checking every key before anything is computed.

This reads what the simulator can act on: fixed nodes, displacements, forces, gravity and resection. A boundary or
mechanism of the case format that is not there yet is refused by name, never ignored.
"""

from __future__ import annotations

import contextlib
import difflib
import io
import math
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case, Tissue
from warpbrain.errors import InputError
from warpbrain.frame import METRES
from warpbrain.mesh import TetMesh, read_mesh
from warpbrain.physics.force import NodalForce
from warpbrain.physics.gravity import Gravity
from warpbrain.physics.laws import LAWS, Law
from warpbrain.physics.load import Load
from warpbrain.physics.resection import Resection

#: Signs that turn a case's axes into RAS.
_AXES = {"RAS": (1.0, 1.0, 1.0), "LPS": (-1.0, -1.0, 1.0)}
_ORIGINS = ("measured", "stand-in", "synthetic")
#: Keys of each law, and of each kind of boundary that can be simulated: another one's would mean nothing.
_LAW_KEYS = {name: tuple(law.keys) for name, law in LAWS.items()}
_BOUNDARY_KEYS = {"fixed": (), "displacement": ("value",), "force": ("total", "ramp")}


class _Table:
    """A table of the file that says where it is when something in it is wrong."""

    def __init__(self, file: Path, where: str, values: Any) -> None:
        if not isinstance(values, dict):
            raise InputError(f"{file}: [{where}]: expected a table, found {values!r}")
        self.file, self.where, self.values = file, where, values

    def error(self, key: str, message: str) -> InputError:
        return InputError(
            f"{self.file}: [{self.where}] {key}: {message}" if self.where else f"{self.file}: {key}: {message}"
        )

    def known(self, *keys: str) -> None:
        """Refuse keys that are not known, with the nearest one that is."""
        for key in self.values:
            if key not in keys:
                near = difflib.get_close_matches(key, keys, 1)
                hint = f" (did you mean '{near[0]}'?)" if near else f" (expected one of {', '.join(keys)})"
                raise self.error(key, f"unknown key{hint}")

    def belong(self, owner: str, keys: tuple[str, ...], others: dict[str, tuple[str, ...]]) -> None:
        """Refuse keys that only other laws or kinds have: ignoring them would change what the file means."""
        for key in self.values:
            if key not in keys and any(key in theirs for theirs in others.values()):
                raise self.error(key, f"means nothing with {owner} (it takes {', '.join(keys) or 'no such key'})")

    def has(self, key: str) -> bool:
        return key in self.values

    def text(self, key: str, default: str | None = None, choices: tuple[str, ...] = ()) -> str:
        value = self.values.get(key, default)
        if value is None:
            raise self.error(key, "missing")
        if not isinstance(value, str):
            raise self.error(key, f"expected text, found {_short(value)}")
        if choices and value not in choices:
            raise self.error(key, f"found '{value}', expected one of {', '.join(choices)}")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        value = self.values.get(key, default)
        if value is None:
            raise self.error(key, "missing")
        if not _finite(value):
            raise self.error(key, f"expected a finite number, found {_short(value)}")
        return float(value)

    def numbers(self, key: str, count: int | None = None) -> tuple[float, ...]:
        value = self.values.get(key)
        if value is None:
            raise self.error(key, "missing")
        good = isinstance(value, list) and all(_finite(v) for v in value)
        if not good or (count is not None and len(value) != count):
            raise self.error(key, f"expected {count or 'a list of'} finite numbers, found {_short(value)}")
        return tuple(float(v) for v in value)

    def table(self, key: str) -> _Table:
        if key not in self.values:
            raise InputError(f"{self.file}: [{key}]: missing")
        return _Table(self.file, key, self.values[key])

    def tables(self, key: str) -> list[_Table]:
        values = self.values.get(key, [])
        if not isinstance(values, list):
            raise InputError(f"{self.file}: [[{key}]]: expected a list of tables, found {values!r}")
        return [_Table(self.file, f"{key} {i + 1}", v) for i, v in enumerate(values)]


def _finite(value: Any) -> bool:
    """Whether it is a number of TOML that a float can hold (its integers may have any number of digits)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _short(value: Any) -> str:
    """A value as an error message shows it, on one line of a length that can be read."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def read_case(path: Path) -> Case:
    """Read a case.

    Parameters
    ----------
    path : Path
        A `case.toml`, or the folder that holds it.

    Raises
    ------
    InputError
        If anything in it is wrong: the file, the key, what was found and what was expected.
    """
    file = path / "case.toml" if path.is_dir() else path
    root = _Table(file, "", _parse(file))
    root.known("case", "mesh", "tissue", "body", "boundary", "mechanism", "recording", "specimen")
    if root.has("specimen"):
        raise InputError(f"{file}: [specimen]: laboratory specimens cannot be simulated yet")
    head = root.table("case")
    head.known("name", "title", "origin", "units", "axes", "gravity_axis")
    unit = head.text("units", "mm", tuple(METRES))
    signs = np.array(_AXES[head.text("axes", "RAS", tuple(_AXES))])
    if head.has("gravity_axis") and not any(axis := head.numbers("gravity_axis", 3)):
        raise head.error("gravity_axis", f"expected three numbers that are not all zero, found {list(axis)}")
    mesh = _read_mesh(root.table("mesh"), unit, signs)
    body = root.table("body") if root.has("body") else _Table(file, "body", {})
    body.known("density", "poisson")
    density, poisson = body.number("density", 1211.5), body.number("poisson", 0.45)
    if density <= 0.0:
        raise body.error("density", f"found {density:g}, expected a positive number [kg/m3]")
    if not -1.0 < poisson < 0.5:
        raise body.error("poisson", f"found {poisson:g}, expected a number in the open interval (-1, 0.5)")
    recordings = root.tables("recording")
    fixed, displaced, loads, assumptions = _boundaries(root, mesh, METRES[unit], signs)
    resection = None
    kinds: set[str] = set()
    for mechanism in root.tables("mechanism"):
        kind = mechanism.text("kind")
        if kind in kinds:
            raise mechanism.error("kind", f"a second '{kind}': it would act twice")
        kinds.add(kind)
        term = _mechanism(mechanism, head, density, signs, mesh)
        assumptions.append(term.sentence + term.detail())
        if isinstance(term, Resection):
            resection = term
        else:
            loads.append(term)
    return Case(
        name=head.text("name"),
        title=head.text("title", head.text("name")),
        origin=head.text("origin", choices=_ORIGINS),
        path=file,
        mesh=mesh,
        tissues=_tissues(root, mesh),
        density=density,
        poisson=poisson,
        fixed=tuple(fixed),
        displaced=tuple(displaced),
        loads=tuple(loads),
        resection=resection,
        assumptions=tuple(assumptions),
        unread_recordings=len(recordings),
    )


def _parse(file: Path) -> dict[str, Any]:
    try:
        # some editors begin UTF-8 text with a byte order mark
        return tomllib.loads(file.read_bytes().decode("utf-8-sig"))
    except FileNotFoundError:
        raise InputError(f"{file}: no such file") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: not UTF-8 text (byte {error.start})") from None
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, thousands of brackets
        raise InputError(f"{file}: not valid TOML: {error}") from None


def _read_mesh(table: _Table, unit: str, signs: NDArray[np.float64]) -> TetMesh:
    table.known("file", "tissue")
    name = table.text("file")
    if "\0" in name:
        raise table.error("file", f"expected the name of a file, found {name!r}")
    file = table.file.parent / name
    if not file.resolve().is_relative_to(table.file.parent.resolve()):
        raise table.error("file", f"'{name}' leaves the case folder")
    if not file.is_file():
        raise table.error("file", f"no such file: {file}")
    # meshio prints lines of its own where it gives up; the error says it
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        mesh = read_mesh(file, unit, table.text("tissue", "tissue"))
    if np.all(signs > 0):
        return mesh
    # both axes conventions are right-handed: turning two axes keeps the orientation of the elements
    return TetMesh(mesh.points * signs, mesh.tetrahedra, mesh.tissue, mesh.node_sets, mesh.element_sets)


def _tissues(root: _Table, mesh: TetMesh) -> dict[int, Tissue]:
    table = root.table("tissue")
    tissues = {}
    for key, values in table.values.items():
        entry = _Table(root.file, f"tissue.{key}", values)
        if not re.fullmatch("0|[1-9][0-9]{0,9}", key):
            raise InputError(f"{root.file}: [tissue.{key}]: tissue labels are whole numbers, found '{key}'")
        entry.known(
            "name", "model", "formulation", "prior", *dict.fromkeys(key for law in LAWS.values() for key in law.keys)
        )
        formulation = entry.text("formulation", "coupled", ("coupled", "uncoupled"))
        tissues[int(key)] = Tissue(entry.text("name", f"tissue {key}"), _law(entry), formulation)
    labels = set(np.unique(mesh.tissue).tolist())
    if missing := sorted(labels - set(tissues)):
        raise InputError(f"{root.file}: [tissue.{missing[0]}]: missing, but the mesh has tissue {missing[0]}")
    if unused := sorted(set(tissues) - labels):
        raise InputError(f"{root.file}: [tissue.{unused[0]}]: the mesh has no tissue {unused[0]}")
    return tissues


def _law(entry: _Table) -> Law:
    model = entry.text("model", "neo-hookean", tuple(_LAW_KEYS))
    entry.belong(f"model '{model}'", _LAW_KEYS[model], _LAW_KEYS)
    if entry.values.get("mu") == "prior":
        raise entry.error("mu", "the generative model is not available yet: give a number [Pa]")
    law = LAWS[model]
    values = {key: entry.numbers(key) if kind is list else entry.number(key) for key, kind in law.keys.items()}
    try:
        return law(**values)
    except InputError as error:
        raise InputError(f"{entry.file}: [{entry.where}] {error}") from None


def _members(table: _Table, mesh: TetMesh) -> NDArray[np.bool_]:
    name = table.text("nodes")
    if name not in mesh.node_sets:
        known = ", ".join(sorted(mesh.node_sets)) or "none"
        raise table.error("nodes", f"the mesh has no node set '{name}' (it has {known})")
    members = mesh.node_sets[name]
    if not members.any():
        raise table.error("nodes", f"node set '{name}' is empty")
    return members


def _boundaries(
    root: _Table, mesh: TetMesh, scale: float, signs: NDArray[np.float64]
) -> tuple[list[Any], list[Any], list[Load], list[str]]:
    fixed: list[Any] = []
    displaced: list[Any] = []
    loads: list[Load] = []
    sentences: list[str] = []
    for table in root.tables("boundary"):
        table.known("name", "nodes", "kind", "value", "total", "ramp", "surface", "friction")
        kind = table.text("kind", choices=("fixed", "sliding", "displacement", "force", "pressure", "contact"))
        if kind in _BOUNDARY_KEYS:
            table.belong(f"kind '{kind}'", _BOUNDARY_KEYS[kind], {**_BOUNDARY_KEYS, "": ("surface", "friction")})
        name = table.text("name", table.text("nodes"))
        if kind == "fixed":
            fixed.append((name, _members(table, mesh)))
            sentences.append(f"The {name} does not move.")
        elif kind == "displacement":
            value = scale * signs * np.array(table.numbers("value", 3))
            displaced.append((name, _members(table, mesh), value))
            sentences.append(f"The {name} is moved by {1000.0 * float(np.linalg.norm(value)):.3g} mm.")
        elif kind == "force":
            _members(table, mesh)
            total = signs * np.array(table.numbers("total", 3))
            ramp = _ramp(table)
            try:
                loads.append(NodalForce(nodes=table.text("nodes"), total=tuple(total.tolist()), ramp=ramp))
            except InputError as error:
                raise InputError(f"{table.file}: [{table.where}] {error}") from None
            sentences.append(
                f"A force of {float(np.linalg.norm(total)):.3g} N in all, shared evenly by the nodes of the {name}."
            )
        else:
            raise table.error("kind", f"'{kind}' cannot be simulated yet")
    for name, members in fixed:
        for other, moved, _ in displaced:
            if shared := int((members & moved).sum()):
                raise InputError(f"{root.file}: [[boundary]] '{name}' fixes {shared} nodes that '{other}' displaces")
    return fixed, displaced, loads, sentences


def _ramp(table: _Table) -> tuple[tuple[float, float], ...]:
    ramp = table.values.get("ramp", [])
    pairs = isinstance(ramp, list) and all(isinstance(p, list) and len(p) == 2 and all(map(_finite, p)) for p in ramp)
    if not pairs:
        raise table.error("ramp", f"expected [time, factor] pairs of finite numbers, found {_short(ramp)}")
    return tuple((float(t), float(f)) for t, f in ramp)


def _mechanism(
    table: _Table, head: _Table, density: float, signs: NDArray[np.float64], mesh: TetMesh
) -> Gravity | Resection:
    kind = table.text("kind")
    if kind == "gravity":
        table.known("kind", "csf_level")
        if not head.has("gravity_axis"):
            raise head.error("gravity_axis", "missing, but [[mechanism]] gravity needs to know where 'down' is")
        axis = signs * np.array(head.numbers("gravity_axis", 3))
        level = 0.001 * table.number("csf_level")
        # counted from the whole anatomy: a resection must not move the datum
        lowest = float((-mesh.points @ (axis / np.linalg.norm(axis))).min())
        try:
            return Gravity(direction=tuple(axis.tolist()), density=density, csf_level=level, lowest=lowest)
        except InputError as error:
            raise head.error("gravity_axis", str(error)) from None
    if kind == "resection":
        table.known("kind", "elements")
        resection = Resection(elements=table.text("elements", "resection"))
        try:
            resection.remaining(mesh)
        except InputError as error:
            raise table.error("elements", str(error)) from None
        return resection
    raise table.error("kind", f"'{kind}' cannot be simulated yet (there are: gravity, resection)")
