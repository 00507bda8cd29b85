"""Reads a `case.toml` and its mesh, checking every key before anything is computed.

This reads what the simulator can act on: fixed nodes, displacements, forces, gravity and resection. A boundary or
mechanism of the case format that is not there yet is refused by name, never ignored.
"""

from __future__ import annotations

import difflib
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case, Tissue
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh, read_mesh
from warpbrain.mesh.tet_mesh import MeshError
from warpbrain.physics.force import NodalForce
from warpbrain.physics.gravity import Gravity
from warpbrain.physics.laws import Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.physics.load import Load
from warpbrain.physics.resection import Resection

#: Metres of one unit of length of a case.
_UNITS = {"m": 1.0, "mm": 0.001}
#: Signs that turn a case's axes into RAS.
_AXES = {"RAS": (1.0, 1.0, 1.0), "LPS": (-1.0, -1.0, 1.0)}
_ORIGINS = ("measured", "stand-in", "synthetic")
_LAW_KEYS = {"neo-hookean": ("mu",), "mooney-rivlin": ("C1", "C2"), "ogden": ("mu", "alpha")}


class _Table:
    """A table of the file that says where it is when something in it is wrong."""

    def __init__(self, file: Path, where: str, values: Any) -> None:
        if not isinstance(values, dict):
            raise InputError(f"{file}: [{where}]: expected a table, found {values!r}")
        self.file, self.where, self.values = file, where, values

    def error(self, key: str, message: str) -> InputError:
        return InputError(f"{self.file}: [{self.where}] {key}: {message}")

    def known(self, *keys: str) -> None:
        """Refuse keys that are not known, with the nearest one that is."""
        for key in self.values:
            if key not in keys:
                near = difflib.get_close_matches(key, keys, 1)
                hint = f" (did you mean '{near[0]}'?)" if near else f" (expected one of {', '.join(keys)})"
                raise self.error(key, f"unknown key{hint}")

    def has(self, key: str) -> bool:
        return key in self.values

    def text(self, key: str, default: str | None = None, choices: tuple[str, ...] = ()) -> str:
        value = self.values.get(key, default)
        if value is None:
            raise self.error(key, "missing")
        if not isinstance(value, str):
            raise self.error(key, f"expected text, found {value!r}")
        if choices and value not in choices:
            raise self.error(key, f"found '{value}', expected one of {', '.join(choices)}")
        return value

    def number(self, key: str, default: float | None = None) -> float:
        value = self.values.get(key, default)
        if value is None:
            raise self.error(key, "missing")
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise self.error(key, f"expected a finite number, found {value!r}")
        return float(value)

    def numbers(self, key: str, count: int | None = None) -> tuple[float, ...]:
        value = self.values.get(key)
        if value is None:
            raise self.error(key, "missing")
        good = isinstance(value, list) and all(
            isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in value
        )
        if not good or (count is not None and len(value) != count):
            raise self.error(key, f"expected {count or 'a list of'} finite numbers, found {value!r}")
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
    scale = _UNITS[head.text("units", "mm", tuple(_UNITS))]
    signs = np.array(_AXES[head.text("axes", "RAS", tuple(_AXES))])
    mesh = _read_mesh(root.table("mesh"), scale, signs)
    body = root.table("body") if root.has("body") else _Table(file, "body", {})
    body.known("density", "poisson")
    density, poisson = body.number("density", 1211.5), body.number("poisson", 0.45)
    if density <= 0.0:
        raise body.error("density", f"found {density:g}, expected a positive number [kg/m3]")
    if not -1.0 < poisson < 0.5:
        raise body.error("poisson", f"found {poisson:g}, expected a number in the open interval (-1, 0.5)")
    fixed, displaced, loads, assumptions = _boundaries(root, mesh, scale, signs)
    resection = None
    for mechanism in root.tables("mechanism"):
        term = _mechanism(mechanism, head, density, scale, signs, mesh)
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
    )


def _parse(file: Path) -> dict[str, Any]:
    try:
        with open(file, "rb") as stream:
            return tomllib.load(stream)
    except FileNotFoundError:
        raise InputError(f"{file}: no such file") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: not UTF-8 text (byte {error.start})") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file}: not valid TOML: {error}") from None


def _read_mesh(table: _Table, scale: float, signs: NDArray[np.float64]) -> TetMesh:
    table.known("file", "tissue")
    name = table.text("file")
    file = table.file.parent / name
    if not file.resolve().is_relative_to(table.file.parent.resolve()):
        raise table.error("file", f"'{name}' leaves the case folder")
    if not file.is_file():
        raise table.error("file", f"no such file: {file}")
    try:
        mesh = read_mesh(file, "mm" if scale == _UNITS["mm"] else "m", table.text("tissue", "tissue"))
    except MeshError as error:
        message = str(error)
        raise InputError(message if str(file) in message else f"{file}: {message}") from None
    if np.prod(signs) > 0 and np.all(signs > 0):
        return mesh
    # both axes conventions are right-handed: turning two axes keeps the orientation of the elements
    return TetMesh(mesh.points * signs, mesh.tetrahedra, mesh.tissue, mesh.node_sets, mesh.element_sets)


def _tissues(root: _Table, mesh: TetMesh) -> dict[int, Tissue]:
    table = root.table("tissue")
    tissues = {}
    for key, values in table.values.items():
        entry = _Table(root.file, f"tissue.{key}", values)
        if not key.isdigit():
            raise entry.error(key, "tissue labels are whole numbers")
        entry.known("name", "model", "formulation", "mu", "C1", "C2", "alpha", "prior")
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
    if entry.values.get("mu") == "prior":
        raise entry.error("mu", "the generative model is not available yet: give a number [Pa]")
    try:
        if model == "neo-hookean":
            return NeoHookean(entry.number("mu"))
        if model == "mooney-rivlin":
            return MooneyRivlin(entry.number("C1"), entry.number("C2"))
        return Ogden(entry.numbers("mu"), entry.numbers("alpha"))
    except InputError as error:
        message = str(error)
        raise InputError(
            message if str(entry.file) in message else f"{entry.file}: [{entry.where}] {message}"
        ) from None


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
            loads.append(NodalForce(nodes=table.text("nodes"), total=tuple(total.tolist()), ramp=_ramp(table)))
            sentences.append(
                f"A force of {float(np.linalg.norm(total)):.3g} N in all, shared evenly by the nodes of the {name}."
            )
        else:
            raise table.error("kind", f"'{kind}' cannot be simulated yet")
    return fixed, displaced, loads, sentences


def _ramp(table: _Table) -> tuple[tuple[float, float], ...]:
    ramp = table.values.get("ramp", [])
    try:
        return tuple((float(t), float(f)) for t, f in ramp)
    except (TypeError, ValueError):
        raise table.error("ramp", f"expected [time, factor] pairs, found {ramp!r}") from None


def _mechanism(
    table: _Table, head: _Table, density: float, scale: float, signs: NDArray[np.float64], mesh: TetMesh
) -> Gravity | Resection:
    kind = table.text("kind")
    if kind == "gravity":
        table.known("kind", "csf_level")
        if not head.has("gravity_axis"):
            raise head.error("gravity_axis", "missing, but [[mechanism]] gravity needs to know where 'down' is")
        axis = signs * np.array(head.numbers("gravity_axis", 3))
        level = 0.001 * table.number("csf_level") if table.has("csf_level") else None
        try:
            return Gravity(direction=tuple(axis.tolist()), density=density, csf_level=level)
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
