"""A test problem on tetrahedra, by warpbrain's own solver.

Hexahedra and wedges are cut into tetrahedra. Where the exact solution is homogeneous it does not depend on the
elements, so the golden number is that of the tetrahedra too; where it is not, that is an error here.
"""

from itertools import permutations

import numpy as np
from shapes import oriented

from febio.materials import constitution
from febio.problem import Floats, Problem
from warpbrain.mesh import TetMesh
from warpbrain.physics.load import Load
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Model
from warpbrain.simulation.system import System

#: Corners of a hexahedron by its three local coordinates, 0 or 1.
_CORNER = {
    (0, 0, 0): 0,
    (1, 0, 0): 1,
    (1, 1, 0): 2,
    (0, 1, 0): 3,
    (0, 0, 1): 4,
    (1, 0, 1): 5,
    (1, 1, 1): 6,
    (0, 1, 1): 7,
}


def _kuhn() -> list[list[int]]:
    """The six tetrahedra along the diagonal of a hexahedron."""
    cut = []
    for axes in permutations(range(3)):
        place = [0, 0, 0]
        path = [_CORNER[0, 0, 0]]
        for axis in axes:
            place[axis] = 1
            path.append(_CORNER[place[0], place[1], place[2]])
        cut.append(path)
    return cut


CUTS = {"tet4": [[0, 1, 2, 3]], "hex8": _kuhn(), "penta6": [[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]]}


class _GivenForces(Load):
    """Dead forces on the nodes, as a problem has them."""

    def __init__(self, forces: Floats) -> None:
        super().__init__()
        object.__setattr__(self, "forces", forces)

    def nodal_forces(self, mesh: TetMesh) -> Floats:  # type: ignore[override]
        return self.forces  # type: ignore[attr-defined,no-any-return]


def tetrahedral_mesh(problem: Problem) -> TetMesh:
    """The problem's body; tissues count its materials from 1, node sets `pressure 0`, ... are its loaded faces."""
    names = list(problem.materials)
    cells, tissue = [], []
    for block in problem.elements:
        nodes = np.array(block["nodes"])
        for cut in CUTS[block["type"]]:
            cells.append(nodes[:, cut])
            tissue.append(np.full(len(nodes), 1 + names.index(block["material"])))
    mesh = oriented(np.array(problem.nodes), np.concatenate(cells), np.concatenate(tissue))
    sets = {}
    for i, pressure in enumerate(problem.pressures):
        sets[f"pressure {i}"] = np.isin(np.arange(len(mesh.points)), np.ravel(pressure["faces"]))
    return TetMesh(mesh.points, mesh.tetrahedra, mesh.tissue, node_sets=sets)


def solve_on_tetrahedra(problem: Problem, elements: str, device: str) -> float:
    """The golden number of a static problem whose solution is homogeneous."""
    assert problem.analysis == "static" and not (problem.springs or problem.tractions or problem.body_forces)
    end = problem.end
    mesh = tetrahedral_mesh(problem)
    parts = {i + 1: constitution(problem, name, end) for i, name in enumerate(problem.materials)}
    assert len(parts) == 1, "what acts in one of several materials has no element set here"
    held, values = problem.constraints(end)
    pressures = [
        Pressure(nodes=f"pressure {i}", value=p["value"] * problem.factor(p["curve"], end))
        for i, p in enumerate(problem.pressures)
    ]
    model = Model(
        mesh,
        {label: part.material for label, part in parts.items()},
        constrained=held,
        prescribed=np.where(held, values, 0.0),
        loads=[_GivenForces(problem.nodal_forces(end))] if problem.forces else [],
        mechanisms=[*parts[1].mechanisms, *pressures],
        elements=elements,
    )
    system = System(model, device)
    # where nothing pulls at the supports all forces vanish in the end, and so does what a residual is relative to
    loaded = problem.prescribed or problem.forces or problem.pressures
    options = EquilibriumOptions(tolerance=1e-10 if loaded else 1e-8)
    u = solve_equilibrium(system, options).u[: len(mesh.points)]
    F = _gradients(mesh, u)
    spread = float(np.abs(F - F.mean(axis=0)).max())
    assert spread < 1e-7, f"{problem.name}: not homogeneous: {spread:.2g}"
    return problem.norm(u)


def _gradients(mesh: TetMesh, u: Floats) -> Floats:
    """Deformation gradients (m, 3, 3)."""
    X, x = mesh.points[mesh.tetrahedra], (mesh.points + u)[mesh.tetrahedra]
    edges, moved = X[:, 1:] - X[:, :1], x[:, 1:] - x[:, :1]
    return np.swapaxes(np.linalg.solve(edges, moved), 1, 2)
