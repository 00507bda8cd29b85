"""How wrong meshes of a brain are beside what elements of half the size show: the beliefs `mesh.*` of a diagnosis.

    python bench/mesh_errors.py 0529 0603 --meshes FOLDER   # writes results/mesh_errors.csv; some minutes a case

Each case as declared, under a weight that nothing carries, and with a load on the wall of the cavity alone, on its own
mesh. The limit of a mesh is where one and two refinements of it lead. Of points that move by a fifth of the farthest or
more: the error relative to the displacement of each point; by how many times the change that a refinement makes it is
explained best (`amount`), with a field that varies linearly over the body's radius (`shape`); and what is left, root
mean square of a component. Beside
it the limit of *another* mesh of the same anatomy, that of the concealed truths (15,000 nodes or more; made if FOLDER
lacks it, which needs `pip install 'warpbrain[build]'`): its surface lies elsewhere, too.
"""

from __future__ import annotations

import argparse
import csv
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.atomic import whole_file
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.inference.beliefs import belief
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.physics.mechanisms.traction import Traction
from warpbrain.recordings.comparison import root_mean_square
from warpbrain.recordings.location import locate
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.mesh_error import FinerCase
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from concealed.truth_mesh import truth_mesh

RESULTS = Path(__file__).resolve().parent / "results"
COLUMNS = ("case", "load", "beside", "raw", "amount", "shape_x", "shape_y", "shape_z", "left", "left_95_percent")
#: Points that move by less than this part of the farthest are left out: of nothing there is no relative error.
FAR = 0.2
#: Node set of the wall of the cavity; pressure and traction on it [Pa], and the radius of the traction's patch [m].
CAVITY, PRESSURE, PULL, RADIUS = "resection", -300.0, 1000.0, 0.02


def displacement(case: Case, elements: str = "tet4") -> Floats:
    """Of the nodes (n, 3) [m] that are simulated, corners of elements first."""
    model = replace(model_of(case), elements=elements)
    return np.asarray(EquilibriumSolver(System(model, "cpu")).solve(model.external_forces()).u)


def refinement(case: Case, times: int) -> tuple[TetMesh, list[Floats]]:
    """The mesh that is simulated, and displacements (n, 3) [m] of its nodes by it and after each refinement."""
    mesh, _ = case.remaining
    levels = [displacement(case)]
    for _ in range(times):
        case = FinerCase(case).case
        levels.append(displacement(case)[: len(mesh.points)])
    return mesh, levels


def explained(mesh: TetMesh, levels: list[Floats], limit: Floats) -> tuple[float, ...]:
    """Figures of `COLUMNS` from `raw` on, relative to the displacement of each point.

    `levels`: displacements (n, 3) [m] by the mesh, and after one refinement. `limit` (n, 3) [m].
    """
    length = np.linalg.norm(limit, axis=1)
    far = length > FAR * length.max()
    places = (mesh.points - mesh.points.mean(axis=0)) / mesh.radius
    error, change = (limit - levels[0])[far] / length[far, None], (levels[1] - levels[0])[far] / length[far, None]
    columns = change[:, :, None] * np.column_stack([np.ones(len(places)), places])[far][:, None, :]
    fitted = np.linalg.lstsq(columns.reshape(-1, 4), error.ravel(), rcond=None)[0]
    left = error - columns @ fitted
    farthest = float(np.percentile(np.abs(left), 95.0))
    return root_mean_square(error.ravel()), *fitted.tolist(), root_mean_square(left.ravel()), farthest


def on_the_wall(whole: Case, resection: tuple[Mechanism, ...]) -> dict[str, tuple[Mechanism, ...]]:
    """Mechanisms by the name of a load: a pressure in the cavity, and tractions on two patches of its wall.

    One patch is the farthest from what is held, the other the nearest to it.
    """
    mesh, nodes = whole.remaining
    wall = np.flatnonzero(whole.mesh.node_sets[CAVITY][nodes])
    held = mesh.points[whole.mesh.node_sets["fixed"][nodes]]
    away = np.linalg.norm(mesh.points[wall][:, None] - held, axis=2).min(axis=1)
    loads: dict[str, tuple[Mechanism, ...]] = {"a pressure": (*resection, Pressure(nodes=CAVITY, value=PRESSURE))}
    # half a radius away or more: nearer the patch would pull at what is held
    free = away > RADIUS / 2.0
    ends = {
        "a pull far from what is held": wall[np.argmax(away)],
        "a pull near to it": wall[free][np.argmin(away[free])],
    }
    for load, node in ends.items():
        inwards = mesh.points.mean(axis=0) - mesh.points[node]
        pull = PULL * inwards / np.linalg.norm(inwards)
        centre, value = tuple(mesh.points[node].tolist()), tuple(pull.tolist())
        loads[load] = (*resection, Traction(centre=centre, value=value, radius=RADIUS))
    return loads


def measured(name: str, meshes: Path) -> list[dict[str, str]]:
    """Rows of the table by `COLUMNS`: of a case under each load, beside each limit."""
    whole = replace(find_case(name), recordings=())
    resection = tuple(mechanism for mechanism in whole.mechanisms if isinstance(mechanism, Resection))
    weight = (*resection, Gravity(direction=(0.0, -1.0, 0.0), density=300.0))
    loads = {"as declared": whole.mechanisms, "a weight": weight, **on_the_wall(whole, resection)}
    another, amount, rows = truth_mesh(name, meshes), belief("mesh.amount"), []
    for load, mechanisms in loads.items():
        case = replace(whole, mechanisms=mechanisms)
        mesh, levels = refinement(case, 2)
        other, of_other = refinement(replace(case, mesh=another), 1)
        there = locate(other.points, other.tetrahedra, mesh.points)
        limits = {
            "its limit": levels[1] + amount * (levels[2] - levels[1]),
            "the limit of another mesh": there.interpolate(of_other[0] + amount * (of_other[1] - of_other[0])),
        }
        for beside, limit in limits.items():
            figures = [f"{value:.4f}" for value in explained(mesh, levels, limit)]
            rows.append(dict(zip(COLUMNS, (name, load, beside, *figures), strict=True)))
            print(rows[-1], flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="+")
    parser.add_argument("--meshes", type=Path, required=True, help="folder of the other meshes")
    arguments = parser.parse_args()
    rows = [row for name in arguments.cases for row in measured(name, arguments.meshes)]
    with whole_file(RESULTS / "mesh_errors.csv") as file, file.open("w", encoding="utf-8") as text:
        writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
