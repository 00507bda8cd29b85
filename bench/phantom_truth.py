"""The concealed phantom's truth: another mesh of the same body, quadratic tetrahedra, another code (FElupe).

MMG remeshes the inside of the coarse phantom and keeps its surface, so that both meshes are of one body, held at the
same triangles and pressed on by the same load: linear between the nodes of the cap, of which each has an equal share.

    python bench/phantom_truth.py single      # writes results/phantom_truth_single.csv; some minutes
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import felupe
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import diags
from scipy.sparse.linalg import cg
from scipy.spatial import cKDTree

from warpbrain.cases.building.mmg import run_mmg
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.mesh import TetMesh, boundary_faces, node_areas

Floats = NDArray[np.float64]

RESULTS = Path(__file__).parent / "results"
#: Force on the cap [N]: a few mm, where the paper's 10 N has no stable equilibrium (docs/phantom.md).
FORCE = {"single": 0.5, "multi": 1.5}
#: Edges inside, in parts of the mean edge of the mesh that estimates.
FINER = 0.75
_SIDES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])


def remeshed(mesh: TetMesh) -> TetMesh:
    """Other tetrahedra between the same triangles."""
    sides = mesh.points[mesh.tetrahedra[:, _SIDES]]
    edge = float(np.linalg.norm(sides[:, :, 1] - sides[:, :, 0], axis=2).mean())
    options = {"nosurf": 1, "hsiz": 1000.0 * FINER * edge, "verbose": -1}
    made = run_mmg(1000.0 * mesh.points, mesh.tetrahedra.astype(np.int64), mesh.tissue.astype(np.int64), options)
    assert made is not None, "MMG gave up"
    points, tetrahedra, labels = made
    distance, nearest = cKDTree(mesh.points).query(points / 1000.0)
    old = distance < 1e-9
    sets = {name: old & members[nearest] for name, members in mesh.node_sets.items()}
    points = np.where(old[:, None], mesh.points[nearest], points / 1000.0)
    return TetMesh(points, tetrahedra, labels, sets)


def quadratic(mesh: TetMesh) -> tuple[Floats, NDArray[np.int64], NDArray[np.int64]]:
    """Points, tetrahedra of ten nodes and the edges whose middles they are."""
    sides = np.sort(mesh.tetrahedra[:, _SIDES], axis=2).reshape(-1, 2)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    points = np.concatenate([mesh.points, mesh.points[edges].mean(axis=1)])
    return points, np.concatenate([mesh.tetrahedra, len(mesh.points) + number.reshape(-1, 6)], axis=1), edges


def cap_forces(mesh: TetMesh, edges: NDArray[np.int64], total: float) -> Floats:
    """Consistent nodal forces [N] (downwards) on quadratic triangles of the load that is linear between nodes."""
    faces = boundary_faces(mesh.tetrahedra)
    cap = mesh.node_sets["superior"]
    areas = node_areas(mesh.points, faces)
    density = np.where(cap, total / cap.sum() / np.where(cap, areas, 1.0), 0.0)
    number = {tuple(edge): len(mesh.points) + k for k, edge in enumerate(edges.tolist())}
    corner = mesh.points[faces]
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    forces = np.zeros(len(mesh.points) + len(edges))
    # integrals of linear times quadratic shape functions: 1/30 at the same corner, -1/60 at the others, 2/15 at a
    # middle beside it, 1/15 at the one opposite
    for face, a in zip(faces.tolist(), area.tolist(), strict=True):
        for i in range(3):
            load = a * density[face[i]]
            j, k = face[(i + 1) % 3], face[(i + 2) % 3]
            forces[face[i]] += load / 30.0
            forces[[j, k]] -= load / 60.0
            for other in (j, k):
                forces[number[min(face[i], other), max(face[i], other)]] += 2.0 * load / 15.0
            forces[number[min(j, k), max(j, k)]] += load / 15.0
    return np.stack([np.zeros_like(forces), np.zeros_like(forces), -forces], axis=1)


def solve(case: Case, mesh: TetMesh, total: float) -> Floats:
    """Displacement [m] of the corners."""
    points, tetrahedra, edges = quadratic(mesh)
    whole = felupe.Mesh(points, tetrahedra, "tetra10")
    field = felupe.FieldContainer([felupe.Field(felupe.RegionQuadraticTetra(whole), dim=3)])
    items = []
    for label in np.unique(mesh.tissue).tolist():
        mu = case.tissues[label].known_law.shear_modulus
        law = felupe.NeoHookeCompressible(mu=mu, lmbda=2.0 * mu * case.poisson / (1.0 - 2.0 * case.poisson))
        # a part has all points, so that its field is linked to the whole one
        part = felupe.Mesh(points, tetrahedra[mesh.tissue == label], "tetra10")
        own = felupe.FieldContainer([felupe.Field(felupe.RegionQuadraticTetra(part), dim=3)])
        items.append(felupe.SolidBody(law, own))
    forces = cap_forces(mesh, edges, total)
    assert np.isclose(forces.sum(), -total)
    loaded = np.flatnonzero(forces.any(axis=1))
    items.append(felupe.PointLoad(field, loaded, values=forces[loaded]))
    held = np.concatenate([mesh.node_sets["fixed"], mesh.node_sets["fixed"][edges].all(axis=1) & outer(mesh, edges)])
    dof0, dof1 = felupe.dof.partition(field, {"fixed": felupe.Boundary(field[0], mask=held)})
    found = felupe.newtonraphson(items=items, x0=field, dof0=dof0, dof1=dof1, tol=1e-8, solver=_solver, verbose=1)
    assert found.success
    return found.x[0].values[: len(mesh.points)]


def outer(mesh: TetMesh, edges: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which edges lie on the surface."""
    faces = boundary_faces(mesh.tetrahedra)
    sides = np.sort(faces[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1).astype(np.int64)
    count = len(mesh.points)
    return np.isin(edges @ [count, 1], sides @ [count, 1])


def _solver(matrix: object, right: Floats) -> Floats:
    found, failed = cg(matrix, right, rtol=1e-9, maxiter=20_000, M=diags(1.0 / matrix.diagonal()))
    assert failed == 0
    return found


def main(tissue: str) -> None:
    """Solve, and write where the nodes of the surface were and how far they went [mm]."""
    case = find_case("phantom", tissue)
    mesh = remeshed(case.mesh)
    print(f"estimates on {case.mesh}", f"concealed {mesh}", sep="\n")
    u = solve(case, mesh, FORCE[tissue])
    surface = np.flatnonzero(mesh.node_sets["surface"] | mesh.node_sets["ventricle"])
    RESULTS.mkdir(exist_ok=True)
    with (RESULTS / f"phantom_truth_{tissue}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["x", "y", "z", "ux", "uy", "uz"])
        for node in surface.tolist():
            writer.writerow([f"{1000.0 * value:.6f}" for value in (*mesh.points[node], *u[node])])


if __name__ == "__main__":
    main(sys.argv[1])
