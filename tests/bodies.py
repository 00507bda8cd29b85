"""Bodies made of one material, and sums over elements written again with NumPy."""

from typing import Any

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from warpbrain.kernels.tetrahedron import PAIRS
from warpbrain.mesh import TetMesh
from warpbrain.simulation.equilibrium import Equilibrium
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.sensitivity import Sensitivities, SensitivitySolver
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]


def model_of(mesh: TetMesh, *materials: Material, **options: Any) -> Model:
    """A model with materials for the tissues 1, 2, ... of a mesh."""
    return Model(mesh, {i + 1: material for i, material in enumerate(materials)}, **options)


def forces_at(system: System, u: Floats) -> Floats:
    system.u.assign(u)
    system.evaluate_forces()
    system.gather_forces()
    return system.internal.numpy().astype(float)


def energy_at(system: System, u: Floats) -> float:
    system.u.assign(u)
    return system.energy()[0]


def stiffness_at(system: System, u: Floats) -> Floats:
    """`K`, dense, summed from the element blocks with NumPy: shape (3 n, 3 n)."""
    system.u.assign(u)
    system.evaluate_tangents()
    blocks = system.element_blocks.numpy().astype(float)
    K = np.zeros((system.size, 3, system.size, 3))
    for k, (a, b) in enumerate(PAIRS):
        for e, nodes in enumerate(system.tetrahedra):
            K[nodes[a], :, nodes[b]] += blocks[e, k]
            if a != b:
                K[nodes[b], :, nodes[a]] += blocks[e, k].T
    return K.reshape(3 * system.size, 3 * system.size)


def matrix_of(system: System) -> sparse.bsr_matrix:
    """The system's matrix as SciPy sees it."""
    A = system.matrix
    nnz = int(A.offsets.numpy()[-1])
    parts = (A.values.numpy()[:nnz].astype(float), A.columns.numpy()[:nnz], A.offsets.numpy())
    return sparse.bsr_matrix(parts, shape=(3 * system.size, 3 * system.size))


def sensitivities(system: System, equilibrium: Equilibrium, *at: Any) -> Sensitivities:
    """Derivatives of an equilibrium; see `SensitivitySolver.solve`."""
    return SensitivitySolver(system).solve(equilibrium.u, *at)
