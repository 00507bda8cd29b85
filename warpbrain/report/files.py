"""Files: bodies for ParaView and 3D Slicer, JSON with units, tables as CSV; and which files a result came from."""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.atomic import whole_file, write_text
from warpbrain.cases.case import Case
from warpbrain.mesh import TetMesh
from warpbrain.mesh.vtu import write_vtu
from warpbrain.recordings.recording import PointsRecording
from warpbrain.simulation.result import Result

#: Millimetres of one metre: lengths are converted where they leave the program, and nowhere else.
MILLIMETRES = 1000.0
#: Cell array of the displacement of midside nodes.
MIDDLES = "displacement_of_edges"


def write_body(path: Path, file: Any) -> None:
    """Write a `meshio.Mesh` as compressed VTU, whole."""
    with whole_file(path) as temporary:
        write_vtu(temporary, file)


def body_file(mesh: TetMesh, at_nodes: dict[str, Any], of_cells: Mapping[str, Any] | None = None) -> Any:
    """A `meshio.Mesh` of tetrahedra in mm with its tissue."""
    import meshio

    cells = {"tissue": [mesh.tissue], **{name: [values] for name, values in (of_cells or {}).items()}}
    return meshio.Mesh(MILLIMETRES * mesh.points, [("tetra", mesh.tetrahedra)], point_data=at_nodes, cell_data=cells)


def sets_of(members: Mapping[str, Any]) -> dict[str, Any]:
    """Sets of nodes or elements as arrays of a file."""
    return {name: inside.astype(np.uint8) for name, inside in members.items()}


def write_result(path: Path, result: Result, mesh_error: Floats | None = None) -> None:
    """Write a result as compressed VTU, coordinates and displacement in mm.

    Point arrays: ``displacement`` [mm], ``reaction`` [N], the node sets, ``fluid_pressure`` [Pa] of drainage and, if it
    was estimated, ``mesh_error`` [mm]: what is to be added to the displacement. Cell arrays: ``tissue``, ``J``,
    ``principal_stretches`` (descending), ``von_mises`` and ``pressure`` [Pa] of the Cauchy stress and, of quadratic
    elements, ``displacement_of_edges`` [mm]: x, y, z in the middle of the edges 01, 02, 03, 12, 13 and 23 of each cell.
    """
    file = file_of_result(result)
    if mesh_error is not None:
        file.point_data["mesh_error"] = mesh_error * MILLIMETRES
    write_body(path, file)


def file_of_result(result: Result) -> Any:
    """What `write_result` writes, as a `meshio.Mesh`."""
    cells = {name: getattr(result, name) for name in ("J", "principal_stretches", "von_mises", "pressure")}
    if result.u_middles is not None:
        cells[MIDDLES] = MILLIMETRES * result.u_middles.reshape(len(result.u_middles), -1)
    # sets first: one of the same name must not replace a result
    at_nodes = {**sets_of(result.mesh.node_sets), "displacement": MILLIMETRES * result.u, "reaction": result.reactions}
    return body_file(result.mesh, {**at_nodes, **result.nodal_pressures}, cells)


def write_summary(path: Path, summary: dict[str, Any]) -> None:
    """Write a summary as JSON; numbers that are not finite become null."""
    text = json.dumps(plain(summary), indent=2, allow_nan=False)
    write_text(path, text + "\n")


def plain(value: Any) -> Any:
    """Dictionaries, lists and Python numbers of what may hold NumPy's."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def picked(instance: Any, *names: str, **renamed: str) -> dict[str, Any]:
    """Attributes of an object for JSON, some by other names than their own."""
    return {key: getattr(instance, name) for key, name in ({name: name for name in names} | renamed).items()}


def write_csv(path: Path, rows: Iterable[Iterable[Any]], lineterminator: str = "\r\n") -> None:
    """Write rows, the names of the columns first, whole."""

    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator=lineterminator).writerows(rows)


def fingerprints(case: Case) -> dict[str, str]:
    """SHA-256 of `case.toml`, mesh and recordings, by their names in the case folder; of those that are there."""
    files = [case.path.name, case.mesh_file]
    for recording in case.recordings:
        files.append(recording.file)
        if isinstance(recording, PointsRecording) and recording.moved_file is not None:
            files.append(recording.moved_file)
    there = [name for name in dict.fromkeys(files) if name and (case.folder / name).is_file()]
    return {name: hashlib.sha256((case.folder / name).read_bytes()).hexdigest() for name in there}


def fingerprint_of(case: Case, *others: str) -> str:
    """Twelve digits that change when a file of the case, its laws or something else that is named changes."""
    laws = [
        f"{label}: {tissue.model} {tissue.formulation} {tissue.prior}" for label, tissue in sorted(case.tissues.items())
    ]
    text = "\n".join([*(f"{name} {value}" for name, value in fingerprints(case).items()), *laws, *others])
    return hashlib.sha256(text.encode()).hexdigest()[:12]
