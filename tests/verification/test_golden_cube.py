"""B2: a block of nearly incompressible material, solved by other codes to ten digits and more."""

import json
from pathlib import Path

import numpy as np
import pytest
from bodies import model_of
from shapes import cube
from verification_rows import Row

from warpbrain.physics.laws import Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.simulation.equilibrium import Equilibrium, EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

NUMBERS = json.loads((Path(__file__).parent / "data" / "golden_cube.json").read_text())
LAWS: dict[str, Law] = {
    "nh": NeoHookean(1.0),
    "mr": MooneyRivlin(0.3, 0.2),
    "ogden_m4p7": Ogden((2.0 / -4.7,), (-4.7,)),
    "ogden_m20": Ogden((2.0 / -20.0,), (-20.0,)),
}


def solve(name: str, n: int, device: str, precision: str, tolerance: float) -> tuple[float, Equilibrium]:
    """Reaction on the top, and the state."""
    mesh = cube(n)
    z = mesh.points[:, 2]
    top = z > 1.0 - 1e-12
    constrained = np.repeat((top | (z < 1e-12))[:, None], 3, axis=1)
    prescribed = np.zeros(mesh.points.shape)
    prescribed[top, 2] = 0.2
    material = Material(LAWS[name], 0.45, "uncoupled")
    model = model_of(mesh, material, constrained=constrained, prescribed=prescribed)
    found = solve_equilibrium(System(model, device, precision), EquilibriumOptions(tolerance=tolerance))
    return float(found.internal[top, 2].sum()), found


@pytest.mark.parametrize("n", [6, 12])
@pytest.mark.parametrize("name", LAWS)
def test_double(name: str, n: int, device: str, verify: Row) -> None:
    expected = NUMBERS[f"{name} n={n}"]
    reaction, found = solve(name, n, device, "double", 1e-11)
    claim, by = "of a stretched cube, four laws, 1,296 and 10,368 elements", "seven codes, the same mesh, 14 digits"
    verify(f"reaction {claim}", by, abs(reaction / expected["reaction"] - 1.0), 1e-10)
    verify(f"stored energy {claim}", by, abs(found.energy / expected["energy"] - 1.0), 1e-12)
    verify(f"displacement {claim}", by, abs(np.linalg.norm(found.u) / expected["u_norm"] - 1.0), 1e-11)
    assert all(step.min_J > 0.0 for step in found.history)


@pytest.mark.parametrize("name", LAWS)
def test_single(name: str, device: str, verify: Row) -> None:
    """Residuals end at 6e-6, 50 roundings of the nodal forces."""
    expected = NUMBERS[f"{name} n=6"]
    reaction, found = solve(name, 6, device, "single", 1e-8)
    errors = {
        "reaction": abs(reaction / expected["reaction"] - 1.0),
        "stored energy": abs(found.energy / expected["energy"] - 1.0),
        "displacement": abs(np.linalg.norm(found.u) / expected["u_norm"] - 1.0),
    }
    for what, error in errors.items():
        verify(f"{what} of the cube in single precision", "seven codes, the same mesh", error, 2e-6)


@pytest.mark.parametrize("name", LAWS)
def test_felupe(name: str, device: str, verify: Row) -> None:
    """What FElupe gives by automatic differentiation, to the error of its perturbed stretches (7e-8)."""
    expected = NUMBERS[f"{name} n=6"]["felupe"]
    reaction, found = solve(name, 6, device, "double", 1e-11)
    claim, by = "of the cube, four laws", "FElupe by automatic differentiation, the same mesh"
    verify(f"reaction {claim}", by, abs(reaction / expected["reaction"] - 1.0), 1e-7)
    verify(f"displacement {claim}", by, abs(np.linalg.norm(found.u) / expected["u_norm"] - 1.0), 1e-8)
