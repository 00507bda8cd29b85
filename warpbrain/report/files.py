"""The files of a run: the deformed body for ParaView and 3D Slicer, and everything that was printed, with units."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.atomic import whole_file
from warpbrain.mesh.vtu import write_vtu
from warpbrain.simulation.result import Result

#: Millimetres of one metre: lengths are converted where they leave the program, and nowhere else.
MILLIMETRES = 1000.0
#: Cell array of the displacement of midside nodes.
MIDDLES = "displacement_of_edges"


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
    with whole_file(path) as temporary:
        write_vtu(temporary, file)


def file_of_result(result: Result) -> Any:
    """What `write_result` writes, as a `meshio.Mesh`."""
    import meshio

    mesh = result.mesh
    return meshio.Mesh(
        mesh.points * MILLIMETRES,
        [("tetra", mesh.tetrahedra)],
        point_data={
            # sets first: one of the same name must not replace a result
            **{name: members.astype(np.uint8) for name, members in mesh.node_sets.items()},
            "displacement": result.u * MILLIMETRES,
            "reaction": result.reactions,
            **result.nodal_pressures,
        },
        cell_data={
            "tissue": [mesh.tissue],
            "J": [result.J],
            "principal_stretches": [result.principal_stretches],
            "von_mises": [result.von_mises],
            "pressure": [result.pressure],
            **({} if result.u_middles is None else {MIDDLES: [_in_rows(result.u_middles)]}),
        },
    )


def _in_rows(u_middles: Floats) -> Floats:
    return MILLIMETRES * u_middles.reshape(len(u_middles), -1)


def write_summary(path: Path, summary: dict[str, Any]) -> None:
    """Write a summary as JSON; numbers that are not finite become null."""
    text = json.dumps(plain(summary), indent=2, allow_nan=False)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def plain(value: Any) -> Any:
    """Dictionaries, lists and Python numbers of what may hold NumPy's."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
