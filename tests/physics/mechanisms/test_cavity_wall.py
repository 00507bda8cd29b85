"""Pressure on the wall of a cavity, closed or open to the surface, beside a resection and a thick sphere."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import energy_at, forces_at, model_of
from shapes import cube, distorted, octant

from warpbrain.cases.assuming import assume
from warpbrain.cases.shipped import find_case
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh, face_vectors, interface_faces, rim_edges
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.cavity import Cavity
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Material
from warpbrain.simulation.of_case import model_of as model_of_case
from warpbrain.simulation.system import System

SOFT = Material(NeoHookean(1000.0), 0.4)
TIGHT = EquilibriumOptions(tolerance=1e-12)
ELEMENTS = ("tet4", "tet4-averaged", "tet10")


def bowl(cells: int = 4) -> TetMesh:
    """A cube with irregular nodes, held below, whose element set reaches its top."""
    lattice = cube(cells)
    inner = np.all((lattice.points > 1e-9) & (lattice.points < 1.0 - 1e-9), axis=1)
    shift = np.random.default_rng(0).uniform(-0.04, 0.04, lattice.points.shape)
    mesh = replace(lattice, points=lattice.points + inner[:, None] * shift)
    away = np.linalg.norm(mesh.centres - [0.5, 0.5, 1.0], axis=1)
    return replace(mesh, element_sets={"bowl": away < 0.35}, node_sets={"foot": mesh.points[:, 2] < 1e-9})


def held(mesh: TetMesh) -> np.ndarray:
    return np.repeat(mesh.node_sets["foot"][:, None], 3, axis=1)


def opened(mesh: TetMesh, pressure: float, left: float, elements: str, device: str) -> np.ndarray:
    acts = [Cavity(elements="bowl", pressure=pressure, left=left)]
    model = model_of(mesh, SOFT, constrained=held(mesh), mechanisms=acts, elements=elements)
    return EquilibriumSolver(System(model, device), TIGHT).solve().u


def resected(mesh: TetMesh, pressure: float, elements: str, device: str) -> tuple[np.ndarray, np.ndarray]:
    wall = np.zeros(len(mesh.points), dtype=bool)
    wall[interface_faces(mesh.tetrahedra, mesh.element_sets["bowl"])] = True
    left, nodes, _ = mesh.with_node_sets({**mesh.node_sets, "wall": wall}).without(mesh.element_sets["bowl"])
    acts = [Pressure(nodes="wall", value=pressure)]
    model = model_of(left, SOFT, constrained=held(left), mechanisms=acts, elements=elements)
    return EquilibriumSolver(System(model, device), TIGHT).solve().u, nodes


@pytest.mark.parametrize("elements", ELEMENTS)
def test_an_open_cavity_becomes_the_resection_as_less_and_less_is_left(elements, device, verify):
    mesh = bowl(3 if elements.startswith("tet10") else 4)
    expected, nodes = resected(mesh, 100.0, elements, device)
    corners = expected[: len(nodes)]
    assert np.abs(corners).max() > 0.01
    errors = []
    for left in (1e-3, 1e-4, 1e-6):
        u = opened(mesh, 100.0, left, elements, device)
        errors.append(np.abs(u[nodes] - corners).max() / np.abs(corners).max())
    # what is left is all that differs: in proportion to it
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.03)
    verify(
        f"cavity open to the surface under pressure, {elements}, 1e-6 of the tissue left",
        "the tissue removed, the same pressure on the wall that is left",
        errors[2],
        3e-5,
    )


def test_an_open_wall_has_exact_forces_no_energy_and_the_symmetric_part_of_its_tangent(device):
    mesh = bowl()
    assert not Cavity(elements="bowl", pressure=150.0).bind(System(model_of(mesh, SOFT), device)).conservative
    faces = interface_faces(mesh.tetrahedra, mesh.element_sets["bowl"])
    u = 0.03 * np.random.default_rng(1).uniform(-1.0, 1.0, mesh.points.shape)

    def forces(at: np.ndarray) -> np.ndarray:
        total = np.zeros_like(at)
        push = 150.0 / 3.0 * face_vectors(mesh.points + at, faces)
        np.add.at(total, faces.ravel(), np.repeat(push, 3, axis=0))
        return total

    system = System(model_of(mesh, SOFT, mechanisms=[Cavity(elements="bowl", pressure=150.0, left=0.5)]), device)
    without = System(model_of(mesh, SOFT, mechanisms=[Cavity(elements="bowl", left=0.5)]), device)
    found = forces_at(system, u) - forces_at(without, u)
    assert np.abs(found - forces(u)).max() <= 1e-11 * np.abs(found).max()
    # the tangent of forces that are quadratic in the displacement: central differences are exact
    size = 3 * len(mesh.points)
    K = np.empty((size, size))
    for k, d in enumerate(np.eye(size)):
        step = 1e-3 * d.reshape(-1, 3)
        K[:, k] = ((forces(u + step) - forces(u - step)) / 2e-3).ravel()
    symmetric, skew = 0.5 * (K + K.T), 0.5 * (K - K.T)
    d = np.random.default_rng(2).normal(size=u.shape)
    for each in (system, without):
        each.u.assign(u)
        each.evaluate_tangents()
    taken = system.stiffness_times(d) - without.stiffness_times(d)
    assert np.abs(taken.ravel() - symmetric @ d.ravel()).max() <= 1e-9 * np.abs(taken).max()
    # what is left out acts along the rim alone: -p/2 int N_a N_b [dx]
    rest = np.zeros_like(K).reshape(len(u), 3, len(u), 3)
    x = mesh.points + u
    for a, b in _along_rim(faces):
        block = np.cross(x[b] - x[a], np.eye(3)).T
        for i, j, share in ((a, a, 2.0), (a, b, 1.0), (b, a, 1.0), (b, b, 2.0)):
            rest[i, :, j] -= 150.0 / 12.0 * share * block
    assert np.abs(rest.reshape(K.shape) - skew).max() <= 1e-9 * np.abs(skew).max()


def _along_rim(faces: np.ndarray) -> list[tuple[int, int]]:
    """Edges of the rim as the triangles run along them."""
    rim = {tuple(edge) for edge in rim_edges(faces).tolist()}
    sides = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()
    return [(a, b) for a, b in sides if (min(a, b), max(a, b)) in rim]


def around_a_shell(n: int) -> TetMesh:
    """An octant of a thick sphere, radii 1 and 2, around a shell down to 1 / sqrt 2 that is an element set."""
    mesh = octant(n, 3 * n // 2, lambda s: 2.0 ** (1.5 * s - 0.5))
    # layers are as thick as they are far away, whatever the facets
    layer = np.arange(len(mesh.tetrahedra)) // (3 * n * n)
    return replace(mesh, element_sets={"inner": layer < n // 2})


def test_a_cavity_in_a_sphere_is_as_wide_as_its_pressure_makes_it(device, verify):
    """C3 of a live pressure of 100 Pa. The rim lies on planes of symmetry and moves in them.

    Sides are straight, so the shape converges with the square of the size, and errors are those of `pressure` there.
    """
    numbers = json.loads((Path(__file__).parents[2] / "verification" / "data" / "structures.json").read_text())
    expected = numbers["C3 thick sphere compressible nh nu=0.45 A=1 B=2 inner pressure 100 Pa"]
    material = Material(NeoHookean(1000.0), 0.45, "uncoupled")

    def widened(n: int) -> np.ndarray:
        mesh = around_a_shell(n)
        acts = [Cavity(elements="inner", pressure=100.0, left=1e-6)]
        model = model_of(mesh, material, constrained=mesh.points == 0.0, mechanisms=acts, elements="tet10")
        u = EquilibriumSolver(System(model, device)).solve().u[: len(mesh.points)]
        radius = np.linalg.norm(mesh.points, axis=1)
        radial = np.sum(u * mesh.points, axis=1) / radius
        return np.array([radial[np.abs(radius - r) < 1e-6].mean() for r in (1.0, 2.0)])

    found = (4.0 * widened(8) - widened(4)) / 3.0
    errors = np.abs(found / [expected["u_inner"], expected["u_outer"]] - 1.0)
    verify(
        "cavity in a thick sphere under live pressure, tet10, extrapolated from 4 and 8 layers",
        "one-dimensional solution, SciPy",
        errors.max(),
        5e-3,
    )


def test_a_cavity_that_closes_on_itself_has_an_energy(device):
    mesh = cube(3)
    inside = np.all(np.abs(mesh.centres - 0.5) < 0.17, axis=1)
    mesh = replace(distorted(mesh, 0.03), element_sets={"inner": inside})
    system = System(model_of(mesh, SOFT, mechanisms=[Cavity(elements="inner", pressure=150.0)]), device)
    assert all(term.conservative for term in system.terms)
    # the volume of the cavity, from its wall, is what the pressure's energy goes with
    u = 0.02 * np.random.default_rng(3).uniform(-1.0, 1.0, mesh.points.shape)
    without = System(model_of(mesh, SOFT, mechanisms=[Cavity(elements="inner")]), device)
    change = (energy_at(system, u) - energy_at(without, u)) - (energy_at(system, 0 * u) - energy_at(without, 0 * u))
    moved = replace(mesh, points=mesh.points + u)
    assert change == pytest.approx(-150.0 * (moved.volumes[inside].sum() - mesh.volumes[inside].sum()), rel=1e-9)


def test_an_open_wall_whose_rim_is_held_has_an_energy(device):
    mesh = bowl()
    rim = np.zeros(len(mesh.points), dtype=bool)
    rim[rim_edges(interface_faces(mesh.tetrahedra, mesh.element_sets["bowl"]))] = True
    assert rim.any()
    constrained = held(mesh) | rim[:, None]
    system = System(
        model_of(mesh, SOFT, constrained=constrained, mechanisms=[Cavity(elements="bowl", pressure=150.0)]), device
    )
    assert all(term.conservative for term in system.terms)
    random = np.random.default_rng(1)
    u, d = (np.where(constrained, 0.0, 0.03 * random.uniform(-1.0, 1.0, mesh.points.shape)) for _ in range(2))
    slope = (energy_at(system, u + 1e-5 * d) - energy_at(system, u - 1e-5 * d)) / 2e-5
    assert np.vdot(forces_at(system, u), d) == pytest.approx(slope, rel=1e-6)


def test_what_touches_no_tissue_that_stays_is_no_cavity():
    mesh = cube(2)
    with pytest.raises(InputError, match="touches no tissue that stays"):
        Cavity(elements="all").check(replace(mesh, element_sets={"all": np.ones(len(mesh.tetrahedra), dtype=bool)}))


def test_a_stand_in_under_ten_pascal_in_its_cavity_is_as_with_its_resection(device, verify):
    """The cavity of 0529 is open to the surface; its node set 'resection' is the wall that its resection leaves."""
    case = find_case("0529")
    pressed = model_of_case(assume(case, "pressure:nodes=resection,value=10"))
    nodes = case.remaining[1]
    whole = replace(case, mechanisms=tuple(m for m in case.mechanisms if m.kind != "resection"))
    open_cavity = model_of_case(assume(whole, "cavity:elements=resection,pressure=10"))
    expected, found = (EquilibriumSolver(System(each, device)).solve() for each in (pressed, open_cavity))
    # as few iterations as without a pressure, although the rim is free
    assert len(found.history) <= 6
    verify(
        "0529 with a cavity that is open to the surface, 10 Pa in it, 1e-4 of its tissue left",
        "its resection with 10 Pa on the wall",
        1e3 * np.linalg.norm(found.u[nodes] - expected.u, axis=1).max(),
        1e-5,
        "mm",
    )
