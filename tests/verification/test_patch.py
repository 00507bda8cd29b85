"""B0, the patch test: linear displacements are reproduced exactly on any mesh, whatever its tissues are called."""

import numpy as np
import pytest
from bodies import forces_at, model_of
from material_point import MATERIALS, random_gradients, random_rotations, stress_at
from shapes import cube, distorted
from verification_rows import Row

from warpbrain.kernels.module import Precision
from warpbrain.physics.laws import NeoHookean, Ogden
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

N = 4
REGULAR = cube(N)
BOUNDARY = np.any((REGULAR.points < 1e-9) | (REGULAR.points > 1.0 - 1e-9), axis=1)
#: Every node moved by up to a fifth of a cell; three tissues dealt out at random.
MESH = distorted(REGULAR, 0.05, tissues=3)
F = random_gradients(1, 0.2, seed=11)[0]
every_material = pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS.keys())


@every_material
def test_interior_is_in_balance(material: Material, precision: Precision, device: str, verify: Row) -> None:
    system = System(model_of(MESH, *[material] * 3), device, precision.name)
    forces = forces_at(system, MESH.points @ (F - np.eye(3)).T)
    # 1e-12 of the largest force in double precision: some twenty element forces that cancel
    tolerance = {"double": 1e-12, "single": 100.0 * precision.epsilon}[precision.name]
    error = np.abs(forces[~BOUNDARY]).max() / np.abs(forces[BOUNDARY]).max()
    claim = f"patch test, distorted mesh, every law, {precision.name} precision: forces inside"
    verify(claim, "none", error, tolerance)


@every_material
def test_stress_is_uniform(material: Material, device: str, verify: Row) -> None:
    system = System(model_of(MESH, *[material] * 3), device)
    system.u.assign(MESH.points @ (F - np.eye(3)).T)
    P = stress_at(material, F[None], device)[0]
    error = np.abs(system.stresses() - P).max() / np.abs(P).max()
    verify("patch test, distorted mesh, every law: stress", "the law's", error, 1e-11)


@every_material
def test_rotation_is_free_of_stress(material: Material, device: str) -> None:
    system = System(model_of(MESH, *[material] * 3), device)
    R = random_rotations(1, seed=12)[0]
    system.u.assign(MESH.points @ (R - np.eye(3)).T)
    assert np.abs(system.stresses()).max() <= 1e-12 * material.volumetric_modulus


def test_equilibrium_finds_the_patch(device: str, verify: Row) -> None:
    """From rest, with the boundary moved: through tissues of two laws that are one."""
    same = Material(NeoHookean(1000.0)), Material(Ogden((1000.0,), (2.0,))), Material(Ogden((400.0, 600.0), (2.0, 2.0)))
    affine = MESH.points @ (F - np.eye(3)).T
    constrained = np.repeat(BOUNDARY[:, None], 3, axis=1)
    model = model_of(MESH, *same, constrained=constrained, prescribed=np.where(constrained, affine, 0.0))
    found = solve_equilibrium(System(model, device), EquilibriumOptions(tolerance=1e-12))
    error = np.abs(found.u - affine).max()
    verify("patch test, distorted mesh, three laws that are one: displacement", "exact", error, 1e-11, "m")
