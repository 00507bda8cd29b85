"""Contact: a patch test through it, lifting, sliding without loss of energy, and slopes."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import energy_at, forces_at, model_of
from shapes import cube, distorted, room, sphere

from warpbrain.cases.assuming import assume
from warpbrain.cases.shipped import find_case
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.load import NodalForce
from warpbrain.physics.mechanisms.contact import Contact
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.model import Damping, Material, Model
from warpbrain.simulation.of_case import model_of as model_of_case
from warpbrain.simulation.relaxation import relax_to_rest
from warpbrain.simulation.system import System

SOFT = Material(NeoHookean(800.0), 0.4)


def on_table(mesh: TetMesh) -> TetMesh:
    z = mesh.points[:, 2]
    return replace(mesh, node_sets={"below": z < 1e-9, "above": z > 1.0 - 1e-9})


def pressed(mesh: TetMesh, down: float, **contact) -> Model:
    """A block on a table, whose top is moved down and does not slide."""
    above = mesh.node_sets["above"]
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    constrained[above, 2] = True
    # what a table without friction leaves free: two slides and a turn
    corner = np.flatnonzero(above & (mesh.points[:, 0] < 1e-9) & (mesh.points[:, 1] < 1e-9))[0]
    side = np.flatnonzero(above & (mesh.points[:, 0] > 1 - 1e-9) & (mesh.points[:, 1] < 1e-9))[0]
    constrained[corner] = True
    constrained[side, 1] = True
    prescribed = np.where(constrained & [False, False, True], -down, 0.0)
    mechanisms = (Contact(nodes="below", **contact),)
    return model_of(mesh, SOFT, constrained=constrained, prescribed=prescribed, mechanisms=mechanisms)


def squeezed(stretch: float) -> float:
    """Lateral stretch of the coupled neo-Hookean block under uniaxial compression."""
    from scipy.optimize import brentq

    lam, mu = SOFT.volumetric_modulus, SOFT.law.shear_modulus
    return brentq(lambda t: mu * (t - 1.0 / t) + lam * np.log(stretch * t * t) / t, 0.5, 2.0)


@pytest.mark.parametrize("state", ["sliding", "lifting"])
def test_a_patch_of_one_stress_passes_through_contact(state):
    mesh = on_table(distorted_inside(3))
    model = pressed(mesh, 0.2, state=state)
    u = solve_equilibrium(System(model, "cpu")).u
    x = mesh.points + u
    t = squeezed(0.8)
    corner = x[np.flatnonzero(mesh.node_sets["above"] & (np.abs(mesh.points[:, :2]).max(axis=1) < 1e-9))[0]]
    expected = mesh.points * [t, t, 0.8] + corner - np.array([0.0, 0.0, 0.8])
    expected[:, 2] = mesh.points[:, 2] * 0.8
    assert np.abs(x - expected).max() < 2e-5


def distorted_inside(n: int) -> TetMesh:
    """A cube whose inner nodes are not where a lattice has them."""
    mesh = cube(n)
    moved = mesh.points.copy()
    inner = np.all((moved > 1e-9) & (moved < 1 - 1e-9), axis=1)
    moved[inner] += np.random.default_rng(0).uniform(-0.05, 0.05, (inner.sum(), 3))
    return replace(mesh, points=moved)


def test_a_block_that_is_lifted_leaves_the_table_without_a_force():
    mesh = on_table(cube(2))
    state = solve_equilibrium(System(pressed(mesh, -0.1, state="lifting"), "cpu"))
    assert np.abs(state.u - [0.0, 0.0, 0.1]).max() < 1e-7
    assert np.abs(state.internal).max() < 1e-4


def test_a_block_that_only_slides_is_stretched():
    mesh = on_table(cube(2))
    x = mesh.points + solve_equilibrium(System(pressed(mesh, -0.1, state="sliding"), "cpu")).u
    assert np.abs(x[:, 2] - 1.1 * mesh.points[:, 2]).max() < 2e-5


@pytest.mark.parametrize("penalty", [5.0, 50.0])
def test_what_is_stuck_does_not_move(penalty, device, verify):
    mesh = on_table(distorted_inside(3))
    model = pressed(mesh, 0.1, state="fixed", penalty=penalty)
    system = System(model, device)
    state = solve_equilibrium(system)
    below = mesh.node_sets["below"]
    slip = np.linalg.norm(state.u[below], axis=1).max()
    verify(f"slip of what is stuck, penalty {penalty:g}", "zero", slip, 1e-7, "m")
    held = replace(model, constrained=model.constrained | below[:, None], mechanisms=())
    expected = solve_equilibrium(System(held, device))
    assert np.abs(state.u - expected.u).max() < 1e-7
    # and what holds it is the reaction of nodes that are held
    above = mesh.node_sets["above"]
    reaction, exact = (found.internal[above].sum(axis=0)[2] for found in (state, expected))
    assert reaction == pytest.approx(exact, rel=1e-5)


def test_what_is_stuck_can_be_moved_where_its_place_is_given(device):
    mesh = on_table(cube(2))
    model = pressed(mesh, 0.1, state="fixed")
    moved = np.flatnonzero(mesh.node_sets["below"])[4]
    constrained, prescribed = model.constrained.copy(), model.prescribed.copy()
    constrained[moved, 0], prescribed[moved, 0] = True, 0.02
    u = solve_equilibrium(System(replace(model, constrained=constrained, prescribed=prescribed), device)).u
    assert u[moved, 0] == 0.02
    others = mesh.node_sets["below"].copy()
    others[moved] = False
    assert max(np.abs(u[others]).max(), np.abs(u[moved, 1:]).max()) < 1e-7


@pytest.mark.parametrize(
    ("state", "friction"), [("fixed", 0.0), ("sliding", 0.0), ("lifting", 0.0), ("lifting", 0.3), ("sliding", 0.3)]
)
def test_a_state_is_in_equilibrium_with_the_pressures_that_are_kept(state, friction, device):
    mesh = on_table(cube(2))
    model = pressed(mesh, 0.1, state=state, friction=friction)
    constrained = model.constrained.copy()
    above = mesh.node_sets["above"]
    constrained[above] = True
    prescribed = np.where(above[:, None], [0.02, 0.0, -0.1], 0.0)
    model = replace(model, constrained=constrained, prescribed=prescribed)
    system = System(model, device)
    found = solve_equilibrium(system)
    again = forces_at(system, found.u)
    np.testing.assert_allclose(again, found.internal, atol=1e-12 * np.abs(found.internal).max())
    left = np.linalg.norm((model.external_forces() - again)[~constrained])
    scale = np.linalg.norm(again) + np.linalg.norm(model.external_forces())
    assert left / scale == pytest.approx(found.residual, rel=1e-3, abs=1e-14) and found.residual <= 1e-8
    (term,) = system.terms
    if friction > 0.0:
        # what rubs is what presses
        pressing, pressure = term.pressing(), np.maximum(term.stiffness * term.gaps(system.u) + term.pressures(), 0.0)
        assert np.abs(pressing - pressure).max() <= 1.001e-3 * pressure.max()


def test_a_frictionless_slide_loses_no_energy():
    mesh = on_table(cube(2))
    model = model_of(
        mesh, SOFT, mechanisms=(Contact(nodes="below", state="sliding"),), damping=Damping(0.0, 0.0), density=1000.0
    )
    system = System(model, "cpu")
    simulator = Simulator(system, time_step=1e-3, tolerance=1e-10)
    velocity = np.tile([0.2, 0.1, 0.0], (system.size, 1))
    simulator.restore(np.zeros_like(velocity), velocity, 0.0)
    before = simulator.kinetic_energy()
    for _ in range(200):
        simulator.step()
    assert simulator.kinetic_energy() + system.energy()[0] == pytest.approx(before, rel=1e-6)
    assert np.abs(system.u.numpy() - [0.04, 0.02, 0.0]).max() < 1e-6


def test_friction_holds_back_what_slides():
    mesh = on_table(cube(2))
    reactions = []
    for friction in (0.0, 0.3):
        model = pressed(mesh, 0.1, state="lifting", friction=friction)
        above = mesh.node_sets["above"]
        constrained = model.constrained.copy()
        constrained[above] = True
        prescribed = np.where(above[:, None], [0.05, 0.0, -0.1], 0.0)
        state = solve_equilibrium(System(replace(model, constrained=constrained, prescribed=prescribed), "cpu"))
        reactions.append(state.internal[above].sum(axis=0))
    assert abs(reactions[0][0]) < 1e-5 * abs(reactions[0][2])
    assert 0.1 < abs(reactions[1][0] / reactions[1][2]) < 0.3 + 1e-3


def test_a_node_that_is_held_beyond_the_wall_is_left_there(device):
    mesh = on_table(cube(2))
    model = pressed(replace(mesh, points=mesh.points - [0.0, 0.0, 0.01]), 0.0, state="lifting", surface=room(5.0))
    held = np.flatnonzero(mesh.node_sets["below"])[0]
    constrained = model.constrained.copy()
    constrained[held] = True
    u = solve_equilibrium(System(replace(model, constrained=constrained), device)).u
    free = mesh.node_sets["below"].copy()
    free[held] = False
    assert np.abs(u[held]).max() == 0.0
    assert np.abs(u[free, 2] - 0.01).max() < 2e-5


@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize(
    ("state", "augmented"),
    [("fixed", False), ("fixed", True), ("sliding", False), ("lifting", False), ("lifting", True)],
)
def test_forces_are_the_slope_of_the_energy_and_the_tangent_that_of_the_forces(state, augmented, friction, device):
    mesh = distorted(cube(3), 0.05)
    mesh = replace(mesh, node_sets={"all": np.ones(len(mesh.points), dtype=bool)})
    contact = Contact(nodes="all", state=state, friction=friction)
    system = System(model_of(mesh, SOFT, mechanisms=(contact,)), device)
    random = np.random.default_rng(4)
    u = 0.02 * random.uniform(-1.0, 1.0, mesh.points.shape)
    if augmented:
        system.u.assign(u)
        system.terms[0].augment(system.u)
        u = u + 0.01 * random.uniform(-1.0, 1.0, mesh.points.shape)
    d = random.normal(size=u.shape)
    h = 1e-7
    slope = (energy_at(system, u + h * d) - energy_at(system, u - h * d)) / (2.0 * h)
    assert np.vdot(forces_at(system, u), d) == pytest.approx(slope, rel=1e-6)
    change = (forces_at(system, u + h * d) - forces_at(system, u - h * d)) / (2.0 * h)
    system.u.assign(u)
    system.evaluate_tangents()
    assert np.abs(system.stiffness_times(d) - change).max() <= 1e-6 * np.abs(change).max()


@pytest.mark.slow(1)
@pytest.mark.parametrize("name", ["0529", "phantom"])
@pytest.mark.parametrize(("state", "iterations"), [("sliding", 20), ("lifting", 40)])
def test_a_brain_slides_along_its_own_curved_surface(name, state, iterations, device):
    """Under its weight, and from rest: Newton's method needs as few iterations as where nothing touches."""
    case = replace(find_case(name), gravity_axis=(0.0, -1.0, 0.0))
    case = replace(case, boundaries=tuple(b for b in case.boundaries if b.kind == "fixed"), mechanisms=())
    case = assume(assume(case, "gravity:level=40"), f"contact:nodes=surface,state={state}")
    system = System(model_of_case(case), device)
    state_found = solve_equilibrium(system)
    assert len(state_found.history) <= iterations
    (term,) = system.terms
    gaps = term.gaps(system.u)
    # held in the wall, or off it
    assert gaps.max() < 2e-5 and (gaps.min() > -2e-5 if state == "sliding" else gaps.min() < -1e-3)
    tangential = np.linalg.norm(state_found.u[term.stencils[:, 0]], axis=1)
    assert tangential.max() > 2e-3


def test_it_slides_in_motion_too(device):
    case = assume(assume(find_case("0529"), "gravity:level=40"), "contact:nodes=surface,state=sliding,penalty=500")
    # stiff enough that what the penalty gives way is small: motion knows no augmentation
    system = System(model_of_case(case), device)
    expected = solve_equilibrium(system).u
    relax_to_rest(system)
    assert np.abs(system.u.numpy() - expected).max() < 1e-4 * np.abs(expected).max()


def test_a_body_within_a_given_sphere_moves_up_to_it(device):
    """A cube that is pushed towards a sphere around it, 1 mm away from its edges."""
    mesh = cube(2)
    mesh = replace(mesh, points=0.02 * (mesh.points - 0.5), node_sets={"all": np.ones(len(mesh.points), dtype=bool)})
    skull = sphere(0.011 * np.sqrt(3.0), 4)
    push = NodalForce(nodes="all", total=(0.0, 0.0, -0.05))
    contact = Contact(nodes="all", state="lifting", surface=skull)
    simulator = Simulator(
        System(model_of(mesh, SOFT, loads=(push,), mechanisms=(contact,), damping=Damping(0.01, 30.0)), device),
        time_step=2e-3,
    )
    for _ in range(300):
        simulator.step()
    x = mesh.points + simulator.system.u.numpy()
    reached = np.linalg.norm(x, axis=1).max()
    assert reached == pytest.approx(0.011 * np.sqrt(3.0), abs=1.5e-4)
    assert x[:, 2].mean() < -1e-3
