"""The membrane: its stress against the closed form, and as a wall between two halves."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import model_of
from shapes import box, cube
from verification_rows import Row

from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.load import NodalForce
from warpbrain.physics.mechanisms.falx import Falx
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System

#: So soft that only the membrane is felt: Pa, beside a membrane of 1 MPa.
NOTHING = Material(NeoHookean(1e-3), 0.0)
MODULUS, THICKNESS = 1e6, 1e-3


def with_membrane(mesh: TetMesh) -> TetMesh:
    """The mesh with the plane x = 1/2 as a node set."""
    return replace(mesh, node_sets={"middle": np.abs(mesh.points[:, 0] - 0.5) < 1e-9})


def pulled(stretch: tuple[float, float | None], mesh: TetMesh) -> Model:
    """The plane stretched along y, and along z too or left free there; everything moves along."""
    along, across = stretch
    x = mesh.points
    constrained = np.zeros(x.shape, dtype=bool)
    constrained[:, :2] = True
    constrained[:, 2] = True if across is not None else x[:, 2] < 1e-9
    prescribed = np.zeros(x.shape)
    prescribed[:, 1] = (along - 1.0) * x[:, 1]
    if across is not None:
        prescribed[:, 2] = (across - 1.0) * x[:, 2]
    falx = Falx(nodes="middle", stiffness=MODULUS, thickness=THICKNESS)
    return model_of(mesh, NOTHING, constrained=constrained, prescribed=prescribed, mechanisms=(falx,))


@pytest.mark.parametrize("stretch", [(1.2, 1.0), (1.3, 1.1), (1.1, 1.1)])
def test_stress_in_its_plane_is_that_of_an_incompressible_sheet(
    stretch: tuple[float, float], device: str, verify: Row
) -> None:
    """Cauchy `s = mu (a^2 - 1/(a b)^2)` along y, on a cross-section that the stretches have changed (Treloar)."""
    mesh = with_membrane(cube(4))
    state = solve_equilibrium(System(pulled(stretch, mesh), device))
    a, b = stretch
    stress = MODULUS / 3.0 * (a**2 - 1.0 / (a * b) ** 2)
    thickness = THICKNESS / (a * b)
    middle = mesh.node_sets["middle"] & (mesh.points[:, 1] > 1.0 - 1e-9)
    error = abs(state.internal[middle, 1].sum() / (stress * thickness * b) - 1.0)
    verify("stress in the plane of a stretched `falx`", "closed form of an incompressible sheet", error, 2e-6)


def test_a_strip_of_it_narrows_as_an_incompressible_one_does(device: str, verify: Row) -> None:
    """Pulled along y and free along z: `b = 1/sqrt(a)`, `s = mu (a^2 - 1/a)`."""
    mesh = with_membrane(cube(4))
    a = 1.2
    state = solve_equilibrium(System(pulled((a, None), mesh), device), EquilibriumOptions(tolerance=1e-9))
    middle = mesh.node_sets["middle"]
    z = mesh.points[middle, 2]
    np.testing.assert_allclose(z + state.u[middle, 2], z / np.sqrt(a), atol=1e-5)
    end = middle & (mesh.points[:, 1] > 1.0 - 1e-9)
    expected = MODULUS / 3.0 * (a**2 - 1.0 / a) * THICKNESS / a
    error = abs(state.internal[end, 1].sum() / expected - 1.0)
    verify("force of a strip of `falx` that narrows", "closed form of an incompressible sheet", error, 1e-5)


def test_a_strip_that_bulges_is_an_arc_of_a_circle(device: str, verify: Row) -> None:
    """Clamped at two sides and blown up: tension `T = p r`, stretch that of an arc, `T = mu t (l - l^-3)`."""
    mesh = box((2, 16, 1), (0.2, 1.0, 0.0625))
    x = mesh.points
    mesh = replace(mesh, node_sets={"sheet": x[:, 0] > 0.2 - 1e-9})
    sheet = mesh.node_sets["sheet"]
    constrained = np.zeros(x.shape, dtype=bool)
    constrained[:, 2] = True
    constrained[(x[:, 0] < 1e-9) | (x[:, 1] < 1e-9) | (x[:, 1] > 1.0 - 1e-9)] = True
    radius, half = 1.0, 0.5
    arc = radius / half * np.arcsin(half / radius)
    tension = MODULUS / 3.0 * THICKNESS * (arc - arc**-3)
    acts = (
        Falx(nodes="sheet", stiffness=MODULUS, thickness=THICKNESS),
        Pressure(nodes="sheet", value=-tension / radius),
    )
    u = solve_equilibrium(System(model_of(mesh, NOTHING, constrained=constrained, mechanisms=acts), device)).u
    reached = (x + u)[sheet]
    centre = np.array([0.2 - np.sqrt(radius**2 - half**2), 0.5])
    # 16 straight pieces in the place of an arc
    error = np.abs(np.linalg.norm(reached[:, :2] - centre, axis=1) - radius).max() / radius
    verify("radius of a strip of `falx` blown up to an arc, 16 elements", "closed form", error, 5e-4)


def shift_behind(sheet: bool, device: str) -> float:
    """How far the left half of a block is pushed by the right one [m], with or without a falx between them."""
    mesh = box((8, 6, 6), (0.1, 0.06, 0.06))
    x = mesh.points
    rim = (np.abs(x[:, 1:] - 0.03) > 0.03 - 1e-9).any(axis=1)
    middle = np.abs(x[:, 0] - 0.05) < 1e-9
    mesh = replace(mesh, node_sets={"middle": middle, "pushed": (x[:, 0] > 0.1 - 1e-9) & ~rim})
    constrained = np.repeat((x[:, 0] < 1e-9) | (rim & middle), 3).reshape(-1, 3)
    push = NodalForce(nodes="pushed", total=(-3.0, 0.0, 0.0))
    falx = (Falx(nodes="middle"),) if sheet else ()
    tissue = Material(NeoHookean(1000.0), 0.45)
    u = solve_equilibrium(
        System(model_of(mesh, tissue, constrained=constrained, loads=(push,), mechanisms=falx), device)
    ).u
    return float(np.abs(u[middle, 0]).max())


def test_a_falx_keeps_one_half_from_pushing_the_other(device):
    assert shift_behind(True, device) < 0.5 * shift_behind(False, device)
