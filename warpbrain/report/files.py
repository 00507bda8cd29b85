"""Files: bodies for ParaView and 3D Slicer, and those of results opened again; JSON with units, tables as CSV."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.atomic import whole_file, write_text
from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.gp.process import Process
from warpbrain.gp.trained import MODEL, STUDIES
from warpbrain.mesh import TetMesh
from warpbrain.mesh.patience import patience
from warpbrain.mesh.vtu import read_vtu, write_vtu
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


def write_result(path: Path, result: Result, mesh_error: Floats | None) -> None:
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
    write_text(path, json.dumps(plain(summary), indent=2, allow_nan=False) + "\n")


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


def picked(instance: Any, *names: str, **renamed: str) -> Any:
    """Attributes of an object for JSON, a dictionary, some by other names than their own; None of None."""
    keys = dict(zip(names, names, strict=True)) | renamed
    return None if instance is None else {key: getattr(instance, name) for key, name in keys.items()}


def fingerprints(case: Case, model: Process | None = None) -> dict[str, str]:
    """SHA-256 of `case.toml`, mesh and recordings, by their names in the case folder, and of the files of a generative
    model that does not ship; of those that are there."""
    files = [case.path.name, case.mesh_file]
    for recording in case.recordings:
        files.append(recording.file)
        if isinstance(recording, PointsRecording) and recording.moved_file is not None:
            files.append(recording.moved_file)
    paths = {name: case.folder / name for name in files if name}
    if model is not None and model.folder is not None:
        paths |= {f"generative model, {name}": model.folder / name for name in (MODEL, STUDIES)}
    return {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in paths.items() if path.is_file()}


def fingerprint_of(case: Case, model: Process) -> str:
    """Twelve digits that change when a file of the case, its laws or the generative model changes."""
    laws = [f"{label}: {t.model} {t.formulation} {t.prior}" for label, t in sorted(case.tissues.items())]
    hashes = [f"{name} {value}" for name, value in fingerprints(case, model).items()]
    text = "\n".join([*hashes, *laws, model.name, model.variant])
    return hashlib.sha256(text.encode()).hexdigest()[:12]


#: Files that hold a deformed body, in the order in which they are looked for: of `run`, of `estimate` and `diagnose`,
#: and of `ensemble`.
FILES = ("result.vtu", "state.vtu", "fields.vtu")
#: What is known of a place in the body, as `trust` says it; zero is outside of it.
SEEN, UNSEEN, LEFT = 1, 2, 3
TRUST = {
    SEEN: "recordings see a force, and nothing is left",
    UNSEEN: "recordings see nothing",
    LEFT: "recordings and the declared case disagree",
}


@dataclass(frozen=True, eq=False)
class SavedState:
    """A deformed body: its mesh at rest, without sets, and what its nodes carry."""

    path: Path
    mesh: TetMesh
    #: Displacement (n, 3) [m], of an ensemble its mean; and (m, 6, 3) that of the midside nodes of quadratic elements.
    u: Floats
    middles: Floats | None
    #: Standard deviation of the displacement (n,) [m]: the root of the summed variances of its components.
    deviation: Floats | None
    #: (n,): `SEEN`, `UNSEEN` where recordings see no force, `LEFT` where they and the declared case disagree.
    trust: Ints | None


def read_state(result: Path) -> SavedState:
    """Open the deformed body of a result: of a folder that a command has written, or a file of `FILES`.

    `InputError`, naming the file, what was found and what was expected.
    """
    path = result
    if result.is_dir():
        known = [result / name for name in FILES if (result / name).is_file()]
        if not known:
            raise InputError(f"{result}: found none of {', '.join(FILES)}: it is no folder of a result with a body")
        path = known[0]
    elif not result.is_file():
        raise InputError(f"{result}: no such file or folder")
    try:
        with patience(path):
            file = read_vtu(path)
        cells = file.cells[0].data
        at = {name: np.asarray(values, dtype=np.float64) for name, values in file.point_data.items()}
        of_cells = {name: values[0] for name, values in file.cell_data.items()}
        mesh = TetMesh(file.points / MILLIMETRES, cells, of_cells["tissue"])
    except Exception as error:  # whatever its parsers raise
        detail = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path}: no body of tetrahedra that can be read ({detail})") from None
    u = at.get("displacement", at.get("displacement_mean"))
    if u is None or u.shape != mesh.points.shape or not np.isfinite(u).all():
        raise InputError(f"{path}: displacement: expected a finite vector at each of {len(mesh.points)} nodes")
    middles = None
    if MIDDLES in of_cells:
        middles = np.asarray(of_cells[MIDDLES], dtype=np.float64)
        if middles.shape != (len(cells), 18) or not np.isfinite(middles).all():
            raise InputError(f"{path}: {MIDDLES}: expected 18 finite numbers for each of {len(cells)} tetrahedra")
        middles = middles.reshape(-1, 6, 3) / MILLIMETRES
    deviation = trust = None
    if (spread := at.get("displacement_sd")) is not None:
        deviation = np.asarray(np.linalg.norm(spread.reshape(len(spread), -1), axis=1) / MILLIMETRES)
    if {"blind", "significant"} <= at.keys():
        trust = np.where(at["significant"] > 0.0, LEFT, np.where(at["blind"] > 0.0, UNSEEN, SEEN))
    return SavedState(path, mesh, u / MILLIMETRES, middles, deviation, trust)
