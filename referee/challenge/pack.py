"""Packs case folders whose declared body and sensors are the same into one file for each body."""

from __future__ import annotations

import hashlib
import shutil
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from referee.challenge.export import neutral_of
from referee.challenge.packed import write_body
from referee.challenge.shared import FORCE_NOISE, NAME, SHARED, SharedBody, Tracked
from referee.compliance.neo_hookean import NeoHookeanBody
from referee.compliance.nuisances import NOISES
from referee.compliance.response import DeclaredResponse
from referee.errors import InputError
from referee.run import case_folders
from referee.threads import mapped
from warpbrain.cases.case import Case
from warpbrain.cases.reading import read_case
from warpbrain.mesh import boundary_faces
from warpbrain.recordings.closest import closest_points
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording, SurfaceRecording

_Kind = TypeVar("_Kind", bound=Recording)


def pack(cases: Path, out: Path, workers: int = 1) -> int:
    """Write `out/BODY.npz` for each declared body among case folders, and its mesh; returns how many.

    Parameters
    ----------
    cases : Path
        Folder of case folders as `referee make` writes them.
    out : Path
    workers : int
        Processes.
    """
    of_body: dict[str, list[Path]] = {}
    for folder in case_folders(cases):
        of_body.setdefault(_declared(folder), []).append(folder)
    out.mkdir(parents=True, exist_ok=True)
    # in order of their first cases, which says nothing
    groups = list(of_body.values())
    meshes: dict[bytes, str] = {}
    jobs = []
    for number, folders in enumerate(groups, start=1):
        mesh = (folders[0] / "mesh.vtu").read_bytes()
        name = meshes.setdefault(mesh, f"mesh-{len(meshes) + 1}.vtu")
        if not (out / name).exists():
            shutil.copyfile(folders[0] / "mesh.vtu", out / name)
        jobs.append((f"body-{number:02d}", name, folders))
    with mapped(workers) as each:
        for count, told in enumerate(each(partial(_pack, out), jobs), start=1):
            print(f"{count} of {len(jobs)}: {told}", flush=True)
    return len(jobs)


def _declared(folder: Path) -> str:
    """Hash of all that a case folder declares, and of where it records."""
    case = read_case(folder)
    digest = hashlib.sha256(_text(folder, case).encode())
    digest.update((folder / "mesh.vtu").read_bytes())
    for recording in case.recordings:
        if isinstance(recording, PointsRecording):
            # in nanometres: points that were unpacked differ by rounding
            digest.update(repr(recording.ids).encode() + np.round(1e9 * recording.points).astype(np.int64).tobytes())
            digest.update(b"" if recording.time is None else recording.time.tobytes())
    return digest.hexdigest()


def _text(folder: Path, case: Case) -> str:
    text = (folder / "case.toml").read_text(encoding="utf-8").replace(case.name, NAME)
    for recording in case.recordings:
        if isinstance(recording, ForceRecording) and recording.sigma is not None:
            text = text.replace(repr(recording.sigma), FORCE_NOISE)
    return text


def _pack(out: Path, job: tuple[str, str, Sequence[Path]]) -> str:
    started = time.process_time()
    name, mesh, folders = job
    cases = [read_case(folder) for folder in folders]
    write_body(out / f"{name}.npz", shared_body(cases, _text(folders[0], cases[0]), mesh))
    return f"{name}, {len(cases)} cases, in {time.process_time() - started:.0f} s"


def shared_body(cases: Sequence[Case], text: str, mesh: str) -> SharedBody:
    """The body that cases share.

    Parameters
    ----------
    cases : sequence of Case
        Of one declared body and the same sensors.
    text : str
        Of their `case.toml`, see `SharedBody`.
    mesh : str
        File of the mesh.

    Raises
    ------
    InputError
        If recordings are others than those that `referee make` writes.
    """
    first = cases[0]
    walls = [_of_kind(case, SurfaceRecording) for case in cases]
    forces = [_of_kind(case, ForceRecording) for case in cases]
    recordings: list[Recording] = [_points(first, "fit"), *forces[:1]]
    within = np.zeros((0, 3), np.int64)
    if walls[0]:
        # each node of the wall is read as a point is
        within = boundary_faces(first.mesh.tetrahedra).astype(np.int64)
        within = within[first.mesh.node_sets[walls[0].nodes][within].all(axis=1)]
        at_rest = first.mesh.points[np.unique(within)]
        none = np.zeros_like(at_rest)
        known = {"name": "wall", "file": "", "role": "fit", "sigma": walls[0].sigma}
        recordings.insert(1, PointsRecording(points=at_rest, displacement=none, **known))
    body = NeoHookeanBody(replace(first, recordings=tuple(r for r in recordings if r)))
    response = DeclaredResponse(body)
    faces = np.unique(within, return_inverse=True)[1].reshape(-1, 3)
    moved = first.mesh.points + body.declared.reshape(-1, 3)
    nearest = [closest_points(wall.points, moved, within) for wall in walls if wall]
    neutral = neutral_of(response)
    rows = {name: getattr(neutral, name) for name in SHARED}
    return SharedBody(
        rows=rows | {"sigma_declared": _points(first, "fit").sigma is not None},
        noise=NOISES,
        sigma=response.rows_of.sigma,
        wall_faces=faces,
        text=text,
        mesh=mesh,
        names=np.array([case.name for case in cases]),
        fitted=_tracked(cases, "fit"),
        checked=_tracked(cases, "check"),
        wall=_stacked(cases, [wall.points for wall in walls if wall], (0, 3)),
        wall_face=_stacked(cases, [near.face for near in nearest], (0,)),
        wall_weight=_stacked(cases, [near.weights for near in nearest], (0, 3)),
        force=_stacked(cases, [force.force[-1] for force in forces if force], (0,)),
        force_sigma=np.array([np.nan if force is None else force.sigma for force in forces], dtype=float),
    )


def _stacked(cases: Sequence[Case], values: Sequence[NDArray[Any]], none: tuple[int, ...]) -> NDArray[Any]:
    return np.stack(values) if values else np.zeros((len(cases), *none))


def _of_kind(case: Case, kind: type[_Kind]) -> _Kind | None:
    """The recording of a kind that is to be fitted."""
    return next((r for r in case.recordings if isinstance(r, kind) and r.role == "fit"), None)


def _points(case: Case, role: str) -> PointsRecording:
    found = [r for r in case.recordings if isinstance(r, PointsRecording) and r.role == role]
    if len(found) != 1:
        raise InputError(f"{case.name}: {len(found)} recordings of points with the role '{role}', expected one")
    return found[0]


def _tracked(cases: Sequence[Case], role: str) -> Tracked:
    recordings = [_points(case, role) for case in cases]
    first = recordings[0]
    return Tracked(
        label=np.array(first.ids),
        place=first.points,
        time=np.full(len(first.points), np.nan) if first.time is None else first.time,
        moved=np.stack([recording.displacement for recording in recordings]),
    )
