"""The whole tangent of a pressure within a rim that moves."""

import numpy as np
import pytest
from bodies import forces_at, model_of
from material_point import LAWS
from shapes import box
from verification_rows import Row

from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System


@pytest.mark.parametrize("elements", ["tet4", "tet10"])
def test_stiffness_with_its_skew_part_is_the_derivative_of_forces(elements: str, device: str, verify: Row) -> None:
    """Along random directions, by central differences; without the skew part it is not."""
    mesh = box((2, 2, 1), (0.05, 0.05, 0.03))
    x, y, z = mesh.points.T
    # a patch with a free rim, part of the top
    mesh = TetMesh(mesh.points, mesh.tetrahedra, node_sets={"patch": (z > 0.03 - 1e-9) & (x + y < 0.051)})
    material = Material(LAWS["neo-hookean"])
    pressure = Pressure(nodes="patch", value=-0.8 * material.law.shear_modulus)
    system = System(model_of(mesh, material, mechanisms=[pressure], elements=elements), device)
    rng = np.random.default_rng(0)
    u = 1e-3 * rng.normal(size=(system.size, 3))
    system.u.assign(u)
    symmetric, skew = system.stiffness().tocsr(), system.skew_stiffness()
    for _ in range(3):
        d = rng.normal(size=u.shape)
        step = 1e-6
        slope = (forces_at(system, u + step * d) - forces_at(system, u - step * d)).ravel() / (2.0 * step)
        error = float(np.linalg.norm((symmetric + skew) @ d.ravel() - slope) / np.linalg.norm(slope))
        verify(f"tangent of a pressure within a free rim, {elements}", "central differences of forces", error, 1e-6)
        assert np.linalg.norm(symmetric @ d.ravel() - slope) > 1e-3 * np.linalg.norm(slope)


def test_a_held_rim_has_none(device: str) -> None:
    mesh = box((2, 2, 1), (0.05, 0.05, 0.03))
    top = mesh.points[:, 2] > 0.03 - 1e-9
    mesh = TetMesh(mesh.points, mesh.tetrahedra, node_sets={"top": top})
    rim = top & ((np.abs(mesh.points[:, :2] - 0.025) > 0.025 - 1e-9).any(axis=1))
    held = np.repeat(rim[:, None], 3, axis=1)
    model = model_of(
        mesh, Material(LAWS["neo-hookean"]), mechanisms=[Pressure(nodes="top", value=100.0)], constrained=held
    )
    assert System(model, device).skew_stiffness() is None
