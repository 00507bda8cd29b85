"""Newton's method where the linear solver knows a part of the tangent only."""

import numpy as np
from bodies import model_of
from material_point import LAWS
from shapes import box
from verification_rows import Row

from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.simulation import equilibrium
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Material
from warpbrain.simulation.multisecant import Multisecant
from warpbrain.simulation.system import System

BRAIN = Material(LAWS["neo-hookean"])


def test_it_ends_a_linear_problem_of_a_few_skew_dimensions() -> None:
    """Of a skew part of rank 4, seven steps beyond the first leave nothing; with the symmetric part alone much is."""
    rng = np.random.default_rng(0)
    n = 30
    symmetric = np.diag(rng.uniform(1.0, 3.0, n))
    skew = np.zeros((n, n))
    skew[:4, :4] = rng.normal(size=(4, 4))
    K = symmetric + 0.5 * (skew - skew.T)
    f = rng.normal(size=(n // 3, 3))
    u, secants = np.zeros((n // 3, 3)), Multisecant()
    plain = np.zeros(n)
    for _ in range(8):
        known, left = secants.split(u, f - (K @ u.ravel()).reshape(u.shape))
        u = u + known + np.linalg.solve(symmetric, left.ravel()).reshape(u.shape)
        plain += np.linalg.solve(symmetric, f.ravel() - K @ plain)
    assert np.abs(u.ravel() - np.linalg.solve(K, f.ravel())).max() < 1e-9
    assert np.abs(plain - np.linalg.solve(K, f.ravel())).max() > 1e-3


def test_a_strong_pressure_within_a_free_rim(device: str, verify: Row, monkeypatch) -> None:
    """The state that steps along the symmetric part alone lead to, in far fewer of them."""
    mesh = box((4, 4, 4), (0.05, 0.05, 0.05))
    x, y, z = mesh.points.T
    top = (z > 0.05 - 1e-9) & (np.abs(x - 0.025) < 0.02) & (np.abs(y - 0.025) < 0.02)
    mesh = TetMesh(mesh.points, mesh.tetrahedra, node_sets={"top": top})
    clamped = np.repeat(z[:, None] < 1e-12, 3, axis=1)
    pressure = Pressure(nodes="top", value=-1.2 * BRAIN.law.shear_modulus)
    model = model_of(mesh, BRAIN, constrained=clamped, mechanisms=[pressure])
    options = EquilibriumOptions(tolerance=1e-9)
    found = solve_equilibrium(System(model, device), options)
    monkeypatch.setattr(equilibrium, "_NEAR", 0.0)
    plain = solve_equilibrium(System(model, device), options)
    assert len(found.history) < 0.7 * len(plain.history)
    error = float(np.abs(found.u - plain.u).max() / np.abs(plain.u).max())
    verify("a pressure within a rim that moves: multisecant steps", "the same, symmetric tangent alone", error, 1e-7)
