"""Effects on small bodies whose answer is known."""

import numpy as np
import pytest
from hollow import hollow
from shapes import cube

from concealed.body import Body
from concealed.face_loads import area_vectors, pressure_forces
from concealed.grown_ogden import GrownOgden
from concealed.record import EFFECTS
from concealed.support_effects import MisjudgedLevel, Slip, TurnedHead
from concealed.tissue_effects import Inclusion, Swelling
from concealed.wall_effects import CavityPressure, VentricularPressure, WallTraction
from warpbrain.mesh import boundary_faces, node_areas
from warpbrain.physics.laws.ogden import Ogden
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System

MU, ALPHA, POISSON = (500.0, -125.0), (2.0, -8.0), 0.47
DOWN = Gravity(direction=(0.0, -1.0, 0.0), density=1000.0, csf_level=0.1)


@pytest.fixture(scope="module")
def body() -> Body:
    return hollow()[0]


def moment(points, forces):
    return np.cross(points, forces).sum(axis=0)


def test_walls_are_told_apart(body):
    whole = hollow()[1]
    # three squares of 4, 4 and 6 cm are laid bare
    assert node_areas(body.mesh.points, body.cavity).sum() == pytest.approx(2 * 0.04 * 0.06 + 0.04**2)
    assert node_areas(body.mesh.points, body.ventricle).sum() == pytest.approx(6 * 0.02**2)
    together = len(body.cavity) + len(body.ventricle) + len(body.cortex)
    assert together == len(boundary_faces(body.mesh.tetrahedra))
    assert len(body.mesh.points) < len(whole.points)
    np.testing.assert_array_equal(body.outwards, [-1.0, 0.0, 0.0])
    np.testing.assert_array_equal(hollow("right")[0].outwards, [1.0, 0.0, 0.0])


def test_pressure_in_a_closed_hole_pulls_and_turns_nothing(body):
    random = np.random.default_rng(0)
    points = body.quadratic.points + 0.002 * random.normal(size=body.quadratic.points.shape)
    forces = VentricularPressure(strength=700.0).forces(body, points)
    scale = np.abs(forces).sum()
    assert scale > 0.0
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-12 * scale)
    np.testing.assert_allclose(moment(points, forces), 0.0, atol=1e-12 * scale)


def test_pressure_pushes_on_the_tissue(body):
    points = body.quadratic.points
    ventricles = VentricularPressure(strength=1.0).forces(body, points)
    # a constant load has nothing at the corners of quadratic faces
    nodes = np.unique(body.quadratic.six_nodes(body.ventricle)[:, 3:])
    assert ((points[nodes] - 0.07) * ventricles[nodes]).sum(axis=1).min() > 0.0
    # the wall of the cavity looks to the left, to the front and up: the push is against that
    total = CavityPressure(strength=100.0).forces(body, points).sum(axis=0)
    np.testing.assert_allclose(total, 100.0 * np.array([0.04 * 0.06, -0.04 * 0.06, -0.04 * 0.04]))


def test_pressure_works_against_volume(body):
    """Virtual work of a pressure is pressure times the change of the enclosed volume, at any shape."""
    random = np.random.default_rng(1)
    nodes = body.quadratic.points
    F, change = np.eye(3) + 0.3 * random.normal(size=(3, 3)), random.normal(size=(3, 3))
    forces = pressure_forces(nodes @ F.T, body.quadratic.six_nodes(body.ventricle), 300.0)
    of_volume = np.linalg.det(F) * np.trace(np.linalg.solve(F, change))
    assert (forces * (nodes @ change.T)).sum() == pytest.approx(300.0 * 0.02**3 * of_volume, rel=1e-9)


def test_pressure_of_curved_faces_is_that_of_their_projection():
    """A cap over a plane triangle, bulged by its midside nodes, is pushed as the triangle is: p A, exactly."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    flat = np.concatenate([corners, 0.5 * (corners[[0, 0, 1]] + corners[[1, 2, 2]])])
    bulged = flat + 0.2 * np.eye(3)[2] * np.array([0, 0, 0, 1, 1, 1])[:, None]
    face = np.arange(6)[None]
    np.testing.assert_allclose(area_vectors(flat, face).sum(axis=1), [[0.0, 0.0, 0.5]], atol=1e-15)
    # only the part that looks along the axis is the projection's; the rest pushes on the three open sides
    assert pressure_forces(bulged, face, 2.0)[:, 2].sum() == pytest.approx(-1.0)


def test_traction_is_a_push_in_one_direction(body):
    slanted = (0.0, 0.6, 0.8)
    effect = WallTraction(strength=50.0, wall="cavity", centre=(0.02, 0.1, 0.11), radius=10.0, direction=slanted)
    forces = effect.forces(body, body.quadratic.points)
    area = node_areas(body.mesh.points, body.cavity).sum()
    np.testing.assert_allclose(forces.sum(axis=0), 50.0 * area * np.array(slanted), rtol=1e-3)
    local = WallTraction(strength=50.0, wall="cortex", centre=(0.14, 0.0, 0.14), radius=0.01, direction=(1.0, 0.0, 0.0))
    far = np.linalg.norm(body.quadratic.points - local.centre, axis=1) > 0.06
    assert np.abs(local.forces(body, body.quadratic.points)[far]).max() < 1e-9


def test_growth_leaves_the_law_as_it_is_where_there_is_none():
    mesh = cube(2)
    u = 0.05 * np.random.default_rng(2).normal(size=mesh.points.shape)
    internal = []
    for law in (Ogden(MU, ALPHA), GrownOgden(MU, ALPHA, 0.0)):
        system = System(Model(mesh, {1: Material(law, POISSON, "uncoupled")}), "cpu")
        system.u.assign(u)
        system.evaluate_forces()
        system.gather_forces()
        internal.append(system.internal.numpy())
    np.testing.assert_allclose(internal[1], internal[0], rtol=1e-10, atol=1e-10)


def test_growth_is_the_gradient_of_its_energy_and_balances_itself():
    mesh = cube(2)
    random = np.random.default_rng(3)
    u, step = 0.03 * random.normal(size=mesh.points.shape), 1e-6 * random.normal(size=mesh.points.shape)
    system = System(Model(mesh, {1: Material(GrownOgden(MU, ALPHA, 0.2), POISSON, "uncoupled")}), "cpu")
    energy = []
    for sign in (1, -1):
        system.u.assign(u + sign * step)
        energy.append(system.energy()[0])
    system.u.assign(u)
    system.evaluate_forces()
    system.gather_forces()
    forces = system.internal.numpy()
    assert (forces * step).sum() == pytest.approx((energy[0] - energy[1]) / 2.0, rel=1e-5)
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(moment(mesh.points + u, forces), 0.0, atol=1e-9)


def test_a_free_body_grows_without_stress():
    mesh = cube(2)
    growth = 0.25
    held = np.zeros(mesh.points.shape, dtype=bool)
    # six components: no rigid motion, no stress
    for axis in range(3):
        held[mesh.points[:, axis] == 0.0, axis] = True
    law = GrownOgden(MU, ALPHA, growth)
    state = solve_equilibrium(System(Model(mesh, {1: Material(law, POISSON, "uncoupled")}, constrained=held), "cpu"))
    np.testing.assert_allclose(state.u, (np.cbrt(1.0 + growth) - 1.0) * mesh.points, atol=1e-7)
    assert np.abs(state.internal).max() < 1e-4


def test_swelling_and_inclusion_are_strongest_in_their_middle(body):
    nearest = np.linalg.norm(body.centroids - 0.08, axis=1).argmin()
    centre = tuple(body.centroids[nearest])
    growth = Swelling(strength=0.2, centre=centre, radius=0.02).growth(body)
    assert growth.argmax() == nearest and growth[nearest] == pytest.approx(0.2)
    stiffer = Inclusion(strength=-1.0, centre=centre, radius=0.02).log_stiffness(body)
    assert stiffer.argmin() == nearest and stiffer[nearest] == pytest.approx(-1.0)
    edge = np.linalg.norm(body.centroids - centre, axis=1) / 0.02
    np.testing.assert_allclose(growth, 0.2 * np.exp(-(edge**2)))


def test_slip_holds_only_the_normal(body):
    held = np.repeat(body.mesh.node_sets["fixed"][:, None], 3, axis=1)
    slipped = Slip(strength=0.03, centre=(0.07, 0.07, 0.0)).held(body, held)
    near = body.mesh.node_sets["fixed"] & (np.linalg.norm(body.mesh.points - [0.07, 0.07, 0.0], axis=1) < 0.03)
    assert near.any()
    np.testing.assert_array_equal(slipped[near], np.tile([False, False, True], (near.sum(), 1)))
    np.testing.assert_array_equal(slipped[~near], held[~near])


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_turned_head_has_the_operated_side_up(side):
    body = hollow(side)[0]
    gravity = TurnedHead(strength=90.0).gravity(body, DOWN)
    np.testing.assert_allclose(gravity.direction, -body.outwards, atol=1e-12)
    assert gravity.imaged_direction == DOWN.direction
    np.testing.assert_allclose(TurnedHead(strength=0.0).gravity(body, DOWN).direction, DOWN.direction)


def test_a_misjudged_level_changes_nothing_but_what_is_declared(body):
    effect = MisjudgedLevel(strength=-0.012)
    assert effect.declared_level(0.13) == pytest.approx(0.118)
    assert effect.gravity(body, DOWN) is DOWN
    assert not effect.forces(body, body.quadratic.points).any()


def test_every_effect_has_a_limit_and_a_unit():
    assert len(EFFECTS) == 8
    for kind in EFFECTS.values():
        assert kind.limit > 0.0 and kind.unit
