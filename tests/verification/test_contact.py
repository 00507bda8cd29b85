"""Contact beside what is known of it: Hertz, a pendulum in a bowl, and a block on a slope."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import model_of
from scipy.integrate import solve_ivp
from shapes import box, cube, room, sphere
from verification_rows import Row

from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.contact import Contact, ContactTerm
from warpbrain.physics.mechanisms.gravity import STANDARD_GRAVITY, Gravity
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.model import Damping, Material
from warpbrain.simulation.system import System

# -- Hertz --------------------------------------------------------------------------------------------------------


def test_hertz(device: str, verify: Row) -> None:
    """A block with a round bottom (radius 1 m) is pressed on a floor (Johnson, Contact Mechanics, section 4.2).

    The force rests on Boussinesq's correction for the height, which is of first order in `a / height` = 4 %. Where the
    pressure ends it falls as a root, which elements cut off: 7.6, 6.5 and 5.4 % of it in L2 with 4, 6 and 8 of them
    from the middle to the rim, of the order 1/2 that a root allows.
    """
    radius, about, cells, mu, nu = 1.0, 0.05, 15, 1000.0, 0.3
    steps = about / 4.0 * np.array([*np.ones(6), *1.45 ** np.arange(1, cells - 5)])
    axis = np.concatenate([[0.0], np.cumsum(steps)])
    lattice = box((cells,) * 3, (cells,) * 3)
    place = np.rint(lattice.points).astype(int)
    points, size = axis[place], axis[-1]
    r = np.linalg.norm(points[:, :2], axis=1)
    points[:, 2] += np.minimum(r, 4.0 * about) ** 2 / (2.0 * radius) * (1.0 - points[:, 2] / size)
    below, above = place[:, 2] == 0, place[:, 2] == cells
    mesh = replace(lattice, points=points, node_sets={"below": below})
    # a quarter of the block, its top moved down by a depth for which the contact is about 0.05 m wide
    constrained = np.stack([(place[:, 0] == 0) | above, (place[:, 1] == 0) | above, above], axis=1)
    depth = about**2 / radius
    prescribed = np.where(above[:, None], [0.0, 0.0, -depth], 0.0)
    floor = Contact(nodes="below", state="lifting", surface=room(2.0 * size))
    material = Material(NeoHookean(mu), nu)
    model = model_of(mesh, material, constrained=constrained, prescribed=prescribed, mechanisms=(floor,))
    system = System(model, device)
    force = -4.0 * solve_equilibrium(system).internal[above, 2].sum()

    modulus = 2.0 * mu * (1.0 + nu) / (1.0 - nu**2)
    # Hertz counts from far away; the top is at a finite height, where a half-space would give way by (Boussinesq)
    height = force * (3.0 - 2.0 * nu) / (4.0 * np.pi * mu * size)
    expected = 4.0 / 3.0 * modulus * np.sqrt(radius) * (depth + height) ** 1.5
    verify("force of a round block on a floor", "Hertz, height by Boussinesq", abs(force / expected - 1.0), 0.025)

    # the pressure of that force: a half ellipse over the contact, resolved by five nodes from its middle to its rim
    a = np.cbrt(3.0 * force * radius / (4.0 * modulus))
    ellipse = 1.5 * force / (np.pi * a**2) * np.sqrt(np.maximum(1.0 - (r[below] / a) ** 2, 0.0))
    (term,) = system.terms
    assert isinstance(term, ContactTerm)
    error = np.linalg.norm(term.pressures() - ellipse) / np.linalg.norm(ellipse)
    verify("pressure of a round block on a floor, in L2", "Hertz", error, 0.08)


# -- a pendulum ---------------------------------------------------------------------------------------------------

SIDE, BOWL = 0.012, 0.06
STIFF = Material(NeoHookean(2e4), 0.3)
DENSITY = 1000.0


def slide(time_step: float, end: float, device: str) -> tuple[np.ndarray, float, float, float]:
    """A block let go at the side of a bowl without friction.

    Returns its angles from the lowest point over time, the energy that it had and that it has in the end, and what
    backward Euler took from it [J].
    """
    angle = np.radians(50.0)
    turn = np.array([[np.cos(angle), 0.0, -np.sin(angle)], [0.0, 1.0, 0.0], [np.sin(angle), 0.0, np.cos(angle)]])
    block = cube(2)
    # its lower corners just touch the bowl, which is of triangles: 0.1 mm inside of the sphere
    lower = np.sqrt((BOWL - 1.2e-4) ** 2 - 0.5 * SIDE**2)
    points = (SIDE * (block.points - [0.5, 0.5, 0.0]) - [0.0, 0.0, lower]) @ turn.T
    corners = (block.points[:, 2] < 1e-9) & (np.abs(block.points[:, :2] - 0.5) > 0.4).all(axis=1)
    mesh = TetMesh(points, block.tetrahedra, node_sets={"corners": corners})
    weight = Gravity(direction=(0.0, 0.0, -1.0), density=DENSITY)
    bowl = Contact(nodes="corners", state="lifting", surface=sphere(BOWL, 4))
    model = model_of(mesh, STIFF, density=DENSITY, loads=(weight,), mechanisms=(bowl,), damping=Damping(0.0, 0.0))
    system = System(model, device)
    simulator = Simulator(system, time_step=time_step, tolerance=1e-12, newton=4)
    masses, external = model.node_masses, model.external_forces()

    def potential() -> float:
        return system.energy()[0] - float(np.vdot(external, system.u.numpy()))

    angles, lost = [], 0.0
    u, v, V = np.zeros_like(points), np.zeros_like(points), potential()
    start = V
    for _ in range(round(end / time_step)):
        simulator.step()
        u1, v1, V1 = system.u.numpy().copy(), simulator.v.numpy().copy(), potential()
        system.evaluate_forces()
        system.gather_forces()
        slope = system.internal.numpy() - external
        # what backward Euler takes: half the square of every change of velocity, and what a convex potential is above
        # its tangent
        lost += 0.5 * float(np.sum(masses[:, None] * (v1 - v) ** 2)) + V - V1 + float(np.vdot(slope, u1 - u))
        u, v, V = u1, v1, V1
        middle = masses @ (points + u) / masses.sum()
        angles.append(np.arctan2(middle[0], -middle[2]))
    return np.array(angles), start, V + simulator.kinetic_energy(), lost


@pytest.mark.slow(3)
def test_a_block_in_a_bowl_swings_as_a_pendulum_and_its_energy_is_accounted_for(device: str, verify: Row) -> None:
    end, time_step = 0.25, 1e-3
    angles, before, after, lost = slide(time_step, end, device)
    finer, *_, less = slide(0.5 * time_step, end, device)
    fall = DENSITY * SIDE**3 * STANDARD_GRAVITY * BOWL
    # kinetic, stored, of the contact and of weight, and what the method takes: all there is
    claim = "energy of a block in a bowl with what backward Euler takes, of its fall"
    verify(claim, "what it had", abs(before - after - lost) / fall, 1e-9)
    # a method of first order takes half as much in half the steps
    assert 0.0 < lost < 0.03 * fall
    assert 0.45 < less / lost < 0.65

    arm = np.sqrt((BOWL - 1.2e-4) ** 2 - 0.5 * SIDE**2) - 0.5 * SIDE
    # a cube's moment of inertia about its middle is m s^2 / 6
    rate = STANDARD_GRAVITY * arm / (arm**2 + SIDE**2 / 6.0)
    times = time_step * np.arange(1, len(angles) + 1)
    start = [np.radians(50.0), 0.0]
    swing = solve_ivp(lambda _, y: [y[1], -rate * np.sin(y[0])], (0.0, end), start, t_eval=times, rtol=1e-9)
    assert swing.y[0, -1] < -0.8
    # without the error of first order
    extrapolated = 2.0 * finer[1::2] - angles
    claim = "swing of a block in a bowl, of 1.7 rad"
    verify(claim, "rigid pendulum; extrapolated in time", np.abs(extrapolated - swing.y[0]).max(), 0.005, "rad")


# -- a slope ------------------------------------------------------------------------------------------------------


FRICTION, SLIP = 0.5, 1e-4


def slipped(degrees: float, damping: Damping, end: float, device: str) -> float:
    """How far a block has gone down a slope [m]; friction builds up over a slip of 0.1 mm."""
    block = cube(2)
    mesh = replace(block, points=SIDE * block.points, node_sets={"below": block.points[:, 2] < 1e-9})
    slope = np.radians(degrees)
    weight = Gravity(direction=(np.sin(slope), 0.0, -np.cos(slope)), density=DENSITY)
    floor = Contact(nodes="below", state="lifting", friction=FRICTION, surface=room(0.1))
    model = model_of(mesh, STIFF, density=DENSITY, loads=(weight,), mechanisms=(floor,), damping=damping)
    simulator = Simulator(System(model, device), time_step=1e-3, newton=3)
    while simulator.time < end - 1e-9:
        simulator.step()
    return float(simulator.system.u.numpy()[block.points[:, 2] < 1e-9, 0].mean())


def test_friction_holds_a_block_on_a_slope_below_its_limit(device: str, verify: Row) -> None:
    part = np.tan(np.radians(20.0)) / FRICTION
    went = slipped(20.0, Damping(0.005, 40.0), 0.3, device)
    error = abs(went / (SLIP * part / np.sqrt(1.0 - part**2)) - 1.0)
    verify("creep of a block on a slope below the limit of friction", "closed form", error, 5e-3)


def test_a_block_slides_down_a_slope_above_the_limit_of_friction(device: str, verify: Row) -> None:
    down, across = STANDARD_GRAVITY * np.sin(np.radians(35.0)), STANDARD_GRAVITY * np.cos(np.radians(35.0))

    def rates(_: float, y: np.ndarray) -> list[float]:
        return [y[1], down - FRICTION * across * y[0] / np.hypot(y[0], SLIP)]

    expected = solve_ivp(rates, (0.0, 0.15), [0.0, 0.0], rtol=1e-9).y[0, -1]
    error = abs(slipped(35.0, Damping(0.005, 0.0), 0.15, device) / expected - 1.0)
    verify("slide of a block down a slope above the limit of friction", "ordinary differential equation", error, 0.01)
