"""Writes cases that share bodies as each by itself: `CASE.npz`, and the case folder for codes that mesh and solve."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from referee.challenge.commands import LIST
from referee.challenge.neutral import Floats, write_case
from referee.challenge.packed import PLACED, RECORDED, read_body
from referee.challenge.shared import FORCE_NOISE, NAME, SharedBody, Tracked
from referee.errors import InputError
from referee.threads import mapped

#: Of one millimetre [m], the unit of case folders.
_MM = 1e-3


def unpack(packed: Path, out: Path, only: Sequence[str] = (), workers: int = 1) -> int:
    """Write `out/CASE.npz` and `out/CASE` for each case, and the list of them; returns how many.

    Parameters
    ----------
    packed : Path
        Folder of bodies and meshes.
    out : Path
        Cases that are in it are kept.
    only : sequence of str, optional
        Names of the cases that are written; all if there are none.
    workers : int
        Processes.

    Raises
    ------
    InputError
        If there are no bodies, or one of `only` is not there.
    """
    files = sorted(packed.glob("*.npz"))
    if not files:
        raise InputError(f"{packed}: has no bodies (*.npz)")
    out.mkdir(parents=True, exist_ok=True)
    with mapped(workers) as each:
        names = sorted(name for of_body in each(partial(_unpack, out, only), files) for name in of_body)
    if absent := sorted(set(only) - set(names)):
        raise InputError(f"{packed}: has no case {', '.join(absent)}")
    (out / LIST).write_text("".join(f"{name}\n" for name in names), encoding="ascii")
    return len(names)


def _unpack(out: Path, only: Sequence[str], file: Path) -> list[str]:
    """Write those of a body that are wanted; their names."""
    body = read_body(file)
    wanted = [(k, name) for k, name in enumerate(body.names.tolist()) if name in only or not only]
    for k, name in wanted:
        if not (out / f"{name}.npz").exists():
            shutil.rmtree(out / name, ignore_errors=True)
            _folder(out / name, body, k, file.parent / body.mesh)
            # appears when it is whole
            written = out / f".{name}.npz"
            write_case(written, body.case(k))
            written.rename(out / f"{name}.npz")
    return [name for _, name in wanted]


def _folder(folder: Path, body: SharedBody, k: int, mesh: Path) -> None:
    (folder / "recordings").mkdir(parents=True)
    text = body.text.replace(NAME, str(body.names[k])).replace(FORCE_NOISE, repr(float(body.force_sigma[k])))
    (folder / "case.toml").write_text(text, encoding="utf-8")
    try:
        shutil.copyfile(mesh, folder / "mesh.vtu")
    except OSError as error:
        raise InputError(f"{mesh}: {error}") from None
    _write_points(folder / "recordings" / "points.csv", body.fitted, k)
    _write_points(folder / "recordings" / "check.csv", body.checked, k)
    if len(body.wall_faces):
        rows = [_numbers(point, RECORDED) for point in body.wall[k]]
        _write(folder / "recordings" / "ventricle-wall.csv", "x,y,z", rows)
    if body.force.shape[1]:
        _write(folder / "recordings" / "force.csv", "t,fx,fy,fz", [",".join(map(repr, [1.0, *body.force[k].tolist()]))])


def _write_points(file: Path, tracked: Tracked, k: int) -> None:
    timed = bool(np.isfinite(tracked.time).any())
    rows = []
    for label, time, place, moved in zip(tracked.label, tracked.time, tracked.place, tracked.moved[k], strict=True):
        at = [repr(float(time))] if timed else []
        rows.append(",".join([f'"{label}"', *at, _numbers(place, PLACED), _numbers(moved, RECORDED)]))
    _write(file, "id,t,x,y,z,ux,uy,uz" if timed else "id,x,y,z,ux,uy,uz", rows)


def _numbers(vector: Floats, unit: float) -> str:
    """A vector in millimetres, to the unit that it is a whole number of."""
    digits = round(np.log10(_MM / unit))
    return ",".join(f"{value / _MM:.{digits}f}" for value in vector)


def _write(file: Path, header: str, rows: Sequence[str]) -> None:
    file.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
