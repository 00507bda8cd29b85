"""The files of a diagnosis beside its JSON: the maps, and the case with what was named."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.atomic import UNFINISHED, whole_file
from warpbrain.cases.case import Case
from warpbrain.cases.writing import write_case
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.mesh.vtu import write_vtu
from warpbrain.report.files import MILLIMETRES


def write_map(path: Path, found: Diagnosis) -> None:
    """Write where the mismatch is, and what the data can see, as VTU with coordinates in mm.

    Point arrays: ``score`` (chi-squared of three degrees of freedom of the nearest place), ``significant`` (above the
    threshold of all places), ``region`` (cannot be told from the best place), ``detectable_force`` [mN] and
    ``blind`` (no force of the size that is seen elsewhere would be), ``displacement`` of the base state [mm].
    """
    with whole_file(path) as temporary:
        write_vtu(temporary, file_of_map(found))


def file_of_map(found: Diagnosis) -> Any:
    """What `write_map` writes, as a `meshio.Mesh`."""
    import meshio
    from scipy.spatial import cKDTree

    mesh, where = found.base.at.system.model.mesh, found.map
    nearest = cKDTree(where.sites).query(mesh.points)[1]
    scores = where.scores[nearest]
    return meshio.Mesh(
        mesh.points * MILLIMETRES,
        [("tetra", mesh.tetrahedra)],
        point_data={
            "score": scores,
            "significant": (scores > where.threshold).astype(np.uint8),
            "region": (where.region[nearest] & where.significant).astype(np.uint8),
            "detectable_force": 1000.0 * where.detectable[nearest],
            "blind": (where.detectable[nearest] > where.blind_above).astype(np.uint8),
            "displacement": found.base.at.u * MILLIMETRES,
        },
        cell_data={"tissue": [mesh.tissue]},
    )


def write_explained(folder: Path, case: Case) -> None:
    """Write the case with what was named; one that is there of an earlier diagnosis is replaced."""
    beside = folder.with_name(f"{UNFINISHED}{folder.name}")
    shutil.rmtree(beside, ignore_errors=True)
    write_case(beside, case)
    shutil.rmtree(folder, ignore_errors=True)
    beside.rename(folder)
