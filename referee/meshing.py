"""Makes the meshes that truths are computed on: other tetrahedra between the same triangles, by MMG.

`python -m referee mesh` needs the extra `build`; what it makes is in `referee/meshes` and nothing else needs MMG.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from referee.body import SIDES
from referee.geometry import COARSE, MESHES, NAMES, declared_mesh
from warpbrain.cases.building.mmg import run_mmg
from warpbrain.mesh import TetMesh, boundary_faces

#: Edges inside, in parts of the mean edge of the mesh that the case declares.
INSIDE = 1.3
#: Shortest edges of the mesh that is too coarse on purpose [mm].
TOO_COARSE = 18.0


def _mean_edge(mesh: TetMesh) -> float:
    sides = mesh.points[mesh.tetrahedra[:, SIDES]]
    return float(np.linalg.norm(sides[:, :, 1] - sides[:, :, 0], axis=2).mean())


def _remeshed(mesh: TetMesh, options: dict[str, float]) -> tuple[NDArray[np.float64], TetMesh]:
    made = run_mmg(
        1000.0 * mesh.points, mesh.tetrahedra.astype(np.int64), mesh.tissue.astype(np.int64), {**options, "verbose": -1}
    )
    assert made is not None, "MMG gave up"
    points, tetrahedra, labels = made
    distance, nearest = cKDTree(mesh.points).query(points / 1000.0)
    sets = {name: members[nearest] for name, members in mesh.node_sets.items()}
    return distance, TetMesh(points / 1000.0, tetrahedra.astype(np.int32), labels.astype(np.int32), sets)


def other_inside(mesh: TetMesh) -> TetMesh:
    """Other tetrahedra between the same triangles, which keep their sets of nodes."""
    distance, made = _remeshed(mesh, {"nosurf": 1, "hsiz": 1000.0 * INSIDE * _mean_edge(mesh)})
    old = distance < 1e-9
    _, nearest = cKDTree(mesh.points).query(made.points)
    points = np.where(old[:, None], mesh.points[nearest], made.points)
    return replace(made, points=points, node_sets={name: old & members for name, members in made.node_sets.items()})


def too_coarse(mesh: TetMesh) -> TetMesh:
    """A mesh of the same body that is too coarse; a node of its surface has the sets of the nearest old one."""
    _, made = _remeshed(mesh, {"hmin": TOO_COARSE, "hmax": 1.6 * TOO_COARSE, "hausd": 5.0})
    surface = np.zeros(len(made.points), dtype=bool)
    surface[boundary_faces(made.tetrahedra)] = True
    old = np.unique(boundary_faces(mesh.tetrahedra))
    nearest = old[cKDTree(mesh.points[old]).query(made.points)[1]]
    return replace(made, node_sets={name: surface & members[nearest] for name, members in mesh.node_sets.items()})


def make_meshes() -> None:
    """Make all meshes anew."""
    MESHES.mkdir(parents=True, exist_ok=True)
    for name in NAMES:
        _write(MESHES / f"{name}.npz", other_inside(declared_mesh(name)))
    _write(MESHES / f"{COARSE}.npz", too_coarse(declared_mesh("phantom")))


def _write(file: Path, mesh: TetMesh) -> None:
    # nanometres in whole numbers are a third smaller than doubles
    sets: dict[str, Any] = {
        f"set_{name}": np.flatnonzero(members).astype(np.uint16) for name, members in mesh.node_sets.items()
    }
    np.savez_compressed(
        file,
        points=np.round(1e9 * mesh.points).astype(np.int32),
        tetrahedra=mesh.tetrahedra.astype(np.uint16),
        tissue=mesh.tissue.astype(np.uint8),
        **sets,
    )
