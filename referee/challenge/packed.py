"""The file of a body that cases share: a `.npz` compressed by LZMA, which NumPy reads as any other.

Lengths are whole numbers of the least that is told. Columns are whole numbers of a part of their largest entry, low and
high bytes apart, which compresses better.
"""

from __future__ import annotations

import zipfile
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from referee.challenge.neutral import Floats
from referee.challenge.noise import Noise
from referee.challenge.shared import COLUMNS, SHARED, SharedBody, Tracked
from referee.errors import InputError

#: Version of the format, a number in each file.
VERSION = 1
#: What is recorded [m] and places at rest [m] are whole numbers of these.
RECORDED, PLACED = 1e-7, 1e-9
#: Parts of the largest entry of a column, among rows of one kind.
_PARTS = 2**14 - 1


def write_body(file: Path, body: SharedBody) -> None:
    """Write a body; the same body gives the same file.

    Raises
    ------
    InputError
        If a length is not a whole number of `RECORDED` or `PLACED`.
    """
    arrays: dict[str, Any] = {"version": VERSION, "noise": astuple(body.noise), "text": body.text, "mesh": body.mesh}
    kinds = body.rows["sensor_kind"]
    for name in SHARED:
        values = body.rows[name]
        if name not in COLUMNS:
            arrays[name] = values
            continue
        arrays[f"{name}_bytes"], arrays[f"{name}_unit"] = _parts(values, kinds)
    for group in ("fitted", "checked"):
        tracked: Tracked = getattr(body, group)
        arrays[f"{group}_label"], arrays[f"{group}_time"] = tracked.label, tracked.time
        arrays[f"{group}_place"] = _whole(file, f"{group} places", tracked.place, PLACED)
        arrays[f"{group}_moved"] = _whole(file, f"{group} displacements", tracked.moved, RECORDED)
    arrays |= {name: getattr(body, name) for name in ("sigma", "names", "force", "force_sigma")}
    arrays |= {"wall_faces": body.wall_faces.astype(np.uint16), "wall_face": body.wall_face.astype(np.uint16)}
    arrays["wall"] = _whole(file, "points of the wall", body.wall, RECORDED)
    arrays["wall_weight"] = body.wall_weight.astype(np.float32)
    with zipfile.ZipFile(file, "w") as stored:
        for name, value in arrays.items():
            # without the time of day
            about = zipfile.ZipInfo(f"{name}.npy")
            about.compress_type = zipfile.ZIP_LZMA
            with stored.open(about, "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, np.asarray(value), allow_pickle=False)


def read_body(file: Path) -> SharedBody:
    """Read a body; `InputError` naming the file if it is none."""
    try:
        with np.load(file, allow_pickle=False) as stored:
            if int(stored["version"]) != VERSION:
                raise InputError(f"{file}: version {int(stored['version'])} of the format, expected {VERSION}")
            arrays = {name: stored[name] for name in stored.files}
        rows = {name: arrays[name] for name in SHARED if name not in COLUMNS}
        kinds = rows["sensor_kind"]
        rows |= {name: _columns(arrays[f"{name}_bytes"], arrays[f"{name}_unit"], kinds) for name in COLUMNS}
        rows["sigma_declared"] = bool(rows["sigma_declared"])
        tracked = {
            group: Tracked(
                label=arrays[f"{group}_label"],
                place=PLACED * arrays[f"{group}_place"],
                time=arrays[f"{group}_time"],
                moved=RECORDED * arrays[f"{group}_moved"],
            )
            for group in ("fitted", "checked")
        }
        weight = arrays["wall_weight"].astype(np.float64)
        return SharedBody(
            rows=rows,
            noise=Noise(*map(float, arrays["noise"])),
            sigma=arrays["sigma"],
            wall_faces=arrays["wall_faces"].astype(np.int64),
            text=str(arrays["text"]),
            mesh=str(arrays["mesh"]),
            names=arrays["names"],
            wall=RECORDED * arrays["wall"],
            wall_face=arrays["wall_face"].astype(np.int64),
            wall_weight=weight,
            force=arrays["force"],
            force_sigma=arrays["force_sigma"],
            **tracked,
        )
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{file}: not a body of the challenge: {error}") from None


def _whole(file: Path, what: str, values: Floats, unit: float) -> NDArray[np.int32]:
    whole = np.round(values / unit)
    if not np.abs(values - unit * whole).max(initial=0.0) < 1e-3 * unit:
        raise InputError(f"{file}: {what}: expected whole numbers of {unit:g} m")
    return whole.astype(np.int32)


def _parts(values: NDArray[Any], kinds: NDArray[np.str_]) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Bytes (2, rows, k), low ones first, and the unit (kinds, k) of each kind of row, kinds in order of name."""
    flat = np.asarray(values, dtype=np.float64).reshape(len(values), -1)
    names, kind = np.unique(kinds, return_inverse=True)
    unit = np.stack([np.abs(flat[kind == j]).max(axis=0) for j in range(len(names))]) / _PARTS
    unit = np.where(unit > 0.0, unit, 1.0).astype(np.float32)
    whole = np.round(flat / unit[kind]).astype("<i2")
    return np.moveaxis(whole.view(np.uint8).reshape(*whole.shape, 2), 2, 0), unit.reshape(-1, *values.shape[1:])


def _columns(stored: NDArray[np.uint8], unit: NDArray[np.float32], kinds: NDArray[np.str_]) -> Floats:
    _, kind = np.unique(kinds, return_inverse=True)
    whole = np.ascontiguousarray(np.moveaxis(stored, 0, 2)).view("<i2")[..., 0]
    return whole.reshape(len(kinds), *unit.shape[1:]) * unit[kind].astype(np.float64)
