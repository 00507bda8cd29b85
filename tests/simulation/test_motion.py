"""Backward Euler: closed forms, invariants, and order of convergence."""

import json
from pathlib import Path

import numpy as np
import pytest
from bodies import model_of
from material_point import LAWS
from shapes import box, cube, distorted, tetrahedron
from verification_rows import Row

from warpbrain.errors import SolveError
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.load import NodalForce
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Damping, Material, Model
from warpbrain.simulation.system import System

NUMBERS = json.loads((Path(__file__).parents[1] / "verification" / "data" / "structures.json").read_text())
BRAIN = Material(LAWS["neo-hookean"])
FALL = Gravity(direction=(0.0, 0.0, -1.0), density=1211.5)


def beam(cells: int = 2) -> TetMesh:
    """5 x 5 x 10 cm."""
    return box((cells, cells, 2 * cells), (0.05, 0.05, 0.1))


def clamped_beam(material: Material = BRAIN, cells: int = 2, **options) -> Model:
    mesh = beam(cells)
    constrained = np.repeat(mesh.points[:, 2:] < 1e-12, 3, axis=1)
    return model_of(mesh, material, constrained=constrained, **options)


def momentum(simulator: Simulator) -> np.ndarray:
    mass = simulator.system.model.node_masses
    return mass @ simulator.v.numpy().astype(float)


# -- closed forms -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("newton", [1, 2])
def test_free_fall(newton: int, device: str, precision, verify: Row) -> None:
    """D1: 100 steps of 1 ms."""
    mesh = distorted(cube(2), 0.05, tissues=2)
    model = model_of(mesh, BRAIN, Material(LAWS["ogden -4.7"]), loads=[FALL])
    system = System(model, device, precision.name)
    # CG ends at its first iterations: the forces are those of a rigid fall, the residual what rounding makes of it
    simulator = Simulator(system, tolerance=1e-14 if precision.name == "double" else 1e-6, newton=newton)
    for _ in range(100):
        simulator.step()
    expected = NUMBERS["D1 backward Euler free fall, 100 steps of 1 ms"]
    # a hundred roundings of sums, and in single precision the tolerance of each of 100 solves
    rel = 1e-12 if precision.name == "double" else 2e-5
    assert simulator.time == pytest.approx(0.1)
    off = np.abs(simulator.v.numpy() - [0.0, 0.0, -expected["v"]]).max()
    off = max(off, np.abs(system.u.numpy() - [0.0, 0.0, -expected["x"]]).max())
    verify(f"free fall, 100 steps, {precision.name} precision", "backward Euler by hand", off, rel, "m, m/s")


@pytest.mark.parametrize("newton", [1, 3])
@pytest.mark.parametrize("omega", [100.0, 1000.0])
def test_one_degree_of_freedom(omega: float, newton: int, device: str, verify: Row) -> None:
    """D2: one node of a tetrahedron slides along the opposite face.

    That is a simple shear, in which coupled neo-Hookean tissue is exactly linear: `f = 4 mu/(rho L^2) m u`.
    """
    L, mu, amplitude = 0.1, 1000.0, 0.01
    mesh = tetrahedron(L)
    constrained = np.ones((4, 3), dtype=bool)
    constrained[3, 0] = False
    model = model_of(mesh, Material(NeoHookean(mu)), constrained=constrained, density=4.0 * mu / (omega * L) ** 2)
    system = System(model, device)
    start = np.zeros((4, 3))
    start[3, 0] = amplitude
    system.u.assign(start)
    simulator = Simulator(system, newton=newton, tolerance=1e-14)
    states = [(1.0, 0.0)]
    for _ in range(100):
        simulator.step()
        states.append((system.u.numpy()[3, 0] / amplitude, simulator.v.numpy()[3, 0] / amplitude))
    expected = NUMBERS[f"D2 backward Euler SDOF omega={omega} k_d=1e-3 h=1e-3"]
    # 1e-9 of the first amplitude: the overdamped case ends at 1e-24 of it
    error = max(abs(states[-1][0] - expected["x_100"]), abs(states[-1][1] - expected["v_100"]) / omega)
    verify("one degree of freedom, damped, 100 steps, of the amplitude", "backward Euler by hand", error, 1e-9)
    s = np.array(states)
    step = np.linalg.lstsq(s[:2], s[1:3], rcond=None)[0]
    assert np.abs(np.linalg.eigvals(step)).max() == pytest.approx(expected["spectral_radius"], rel=1e-9)


def test_mass_damping(device: str, verify: Row) -> None:
    """A free body slows down as `v / (1 + h m_d)` a step."""
    system = System(model_of(cube(1), BRAIN, damping=Damping(0.001, 5.0)), device)
    simulator = Simulator(system, tolerance=1e-14)
    simulator.v.assign(np.tile([1.0, -2.0, 0.5], (system.size, 1)))
    for _ in range(20):
        simulator.step()
    error = np.abs(simulator.v.numpy() * 1.005**20 / [1.0, -2.0, 0.5] - 1.0).max()
    verify("velocity of a free body with mass damping, 20 steps", "backward Euler by hand", error, 1e-12)


# -- invariants ---------------------------------------------------------------------------------------------------


def shaken(simulator: Simulator, size: float = 0.3, seed: int = 1) -> None:
    """Random velocities [m/s] on the free components."""
    v = size * np.random.default_rng(seed).normal(size=(simulator.system.size, 3))
    simulator.v.assign(np.where(simulator.system.model.constrained, 0.0, v))


@pytest.mark.parametrize("name", ["neo-hookean", "mooney-rivlin", "ogden -20"])
@pytest.mark.parametrize("newton", [1, 4])
def test_momentum_is_conserved(name: str, newton: int, device: str, verify: Row) -> None:
    system = System(model_of(distorted(beam(), 0.003), Material(LAWS[name], 0.45, "uncoupled")), device)
    simulator = Simulator(system, newton=newton, tolerance=1e-14)
    shaken(simulator)
    before = momentum(simulator)
    scale = np.sum(system.model.node_masses[:, None] * np.abs(simulator.v.numpy()))
    for _ in range(50):
        simulator.step()
    simulator.check()
    error = np.abs(momentum(simulator) - before).max() / scale
    verify("momentum of a free body, 50 steps, three laws", "what it had", error, 1e-12)


@pytest.mark.parametrize("damping", [Damping(0.0), Damping()], ids=["undamped", "damped"])
@pytest.mark.parametrize("clamped", [False, True])
def test_energy_never_grows_without_load(clamped: bool, damping: Damping, device: str) -> None:
    """Kinetic and stored, with the implicit equation solved (D3)."""
    model = clamped_beam(damping=damping) if clamped else model_of(beam(), BRAIN, damping=damping)
    system = System(model, device)
    simulator = Simulator(system, newton=6, tolerance=1e-10)
    shaken(simulator)
    energies = [simulator.kinetic_energy()]
    for _ in range(60):
        simulator.step()
        energies.append(simulator.kinetic_energy() + system.energy()[0])
    simulator.check()
    assert np.all(np.diff(energies) <= 1e-9 * energies[0])
    # part of it swung back and forth meanwhile: this was no rigid motion
    assert energies[-1] < 0.9 * energies[0]


@pytest.mark.parametrize("damping", [Damping(0.0), Damping()], ids=["undamped", "damped"])
def test_first_order_in_the_time_step(damping: Damping, device: str, verify: Row) -> None:
    """D3: successive halvings of h halve the difference, order 1 +- 0.1."""
    ends = []
    for steps in (40, 80, 160):
        system = System(clamped_beam(damping=damping, loads=[FALL], cells=1), device)
        simulator = Simulator(system, time_step=0.04 / steps, newton=4, tolerance=1e-10)
        for _ in range(steps):
            simulator.step()
        simulator.check()
        ends.append(system.u.numpy())
    order = np.log2(np.linalg.norm(ends[1] - ends[0]) / np.linalg.norm(ends[2] - ends[1]))
    verify("motion of a clamped beam: order 1 in time, off by", "backward Euler", abs(order - 1.0), 0.1, "orders")


def test_linearised_step_is_first_order_too(device: str) -> None:
    """The paper's one linearised solve a step tends to the solution of the implicit equation."""
    errors = []
    for steps in (40, 80):
        ends = []
        for newton in (1, 6):
            system = System(clamped_beam(loads=[FALL], cells=1), device)
            simulator = Simulator(system, time_step=0.04 / steps, newton=newton, tolerance=1e-10)
            for _ in range(steps):
                simulator.step()
            ends.append(system.u.numpy())
        errors.append(np.linalg.norm(ends[1] - ends[0]))
    assert errors[1] < 0.6 * errors[0]


# -- prescribed motion --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("newton", [1, 3])
def test_a_moving_clamp_carries_a_body_that_moves_with_it(newton: int, device: str) -> None:
    model = clamped_beam(Material(LAWS["ogden -4.7"]))
    system = System(model, device)
    simulator = Simulator(system, newton=newton, tolerance=1e-13)
    velocity = np.array([0.5, -0.2, 0.1])
    simulator.v.assign(np.tile(velocity, (system.size, 1)))
    for step in range(1, 21):
        simulator.prescribe(np.tile(0.001 * step * velocity, (system.size, 1)))
        simulator.step()
    np.testing.assert_allclose(system.u.numpy(), np.tile(0.02 * velocity, (system.size, 1)), atol=1e-13)
    np.testing.assert_allclose(simulator.v.numpy(), np.tile(velocity, (system.size, 1)), atol=1e-10)


@pytest.mark.parametrize("newton", [1, 3])
def test_a_clamp_arrives_where_it_was_sent_and_stays(newton: int, device: str) -> None:
    system = System(clamped_beam(), device)
    simulator = Simulator(system, newton=newton, tolerance=1e-8)
    clamp = system.model.constrained
    for step in range(1, 11):
        simulator.prescribe(np.where(clamp, [0.0005 * step, 0.0, 0.0], 0.0))
        simulator.step()
    held = np.where(clamp, [0.005, 0.0, 0.0], 0.0)
    np.testing.assert_allclose(system.u.numpy()[clamp], held[clamp], atol=1e-15)
    # the rest lags behind, then follows
    assert system.u.numpy()[~clamp.any(axis=1), 0].min() < 0.003
    # long steps of backward Euler damp what swings, to a third each
    simulator.set_time_step(0.1)
    for _ in range(40):
        simulator.prescribe(held)
        simulator.step()
    simulator.check()
    np.testing.assert_allclose(system.u.numpy(), np.tile([0.005, 0.0, 0.0], (system.size, 1)), atol=1e-7)


def test_a_clamp_stops_where_it_was_sent(device: str) -> None:
    """`prescribe` is about the coming step: without another word the clamp holds still in the ones after it."""
    system = System(clamped_beam(), device)
    simulator = Simulator(system)
    clamp = system.model.constrained
    sent = np.where(clamp, [0.0005, 0.0, 0.0], 0.0)
    simulator.prescribe(sent)
    for _ in range(3):
        simulator.step()
    np.testing.assert_allclose(system.u.numpy()[clamp], sent[clamp], atol=1e-15)


# -- against equilibrium ------------------------------------------------------------------------------------------


def test_great_time_steps_relax_to_equilibrium(device: str) -> None:
    """Inertia and damping are nothing against stiffness at h = 1000 s: each step is one of Newton's."""
    model = clamped_beam(Material(LAWS["mooney-rivlin"], 0.4), loads=[FALL])
    expected = solve_equilibrium(System(model, device), EquilibriumOptions(tolerance=1e-11)).u
    system = System(model, device)
    simulator = Simulator(system, time_step=1e3, tolerance=1e-12)
    for _ in range(12):
        simulator.step()
    simulator.check()
    assert np.abs(system.u.numpy() - expected).max() <= 1e-8 * np.abs(expected).max()


@pytest.mark.slow
def test_motion_comes_to_rest_in_equilibrium(device: str) -> None:
    model = clamped_beam(loads=[FALL], damping=Damping(0.05, 5.0))
    expected = solve_equilibrium(System(model, device)).u
    system = System(model, device)
    simulator = Simulator(system, time_step=0.01)
    for _ in range(500):
        simulator.step()
    assert np.abs(system.u.numpy() - expected).max() <= 1e-5 * np.abs(expected).max()


# -- reproducibility and failure ----------------------------------------------------------------------------------


def test_same_bits_every_time(device: str, precision) -> None:
    def run() -> tuple[np.ndarray, np.ndarray]:
        system = System(clamped_beam(loads=[FALL]), device, precision.name)
        simulator = Simulator(system)
        for _ in range(10):
            simulator.step()
        return system.u.numpy(), simulator.v.numpy()

    for one, other in zip(run(), run(), strict=True):
        assert np.array_equal(one, other)


def test_single_follows_double(device: str) -> None:
    ends = []
    for name in ("double", "single"):
        system = System(clamped_beam(loads=[FALL]), device, name)
        simulator = Simulator(system, tolerance=1e-6)
        for _ in range(50):
            simulator.step()
        ends.append(system.u.numpy().astype(float))
    # 50 solves at 1e-6, and roundings of 1e-7 that the stiffest modes amplify
    assert np.abs(ends[1] - ends[0]).max() <= 1e-4 * np.abs(ends[0]).max()


def test_ramped_load_acts_at_the_end_of_its_step(device: str) -> None:
    mesh = tetrahedron(0.1)
    mesh = TetMesh(mesh.points, mesh.tetrahedra, node_sets={"all": np.ones(4, dtype=bool)})
    force = NodalForce(nodes="all", total=(1.0, 0.0, 0.0), ramp=[(0.0, 0.0), (0.01, 1.0)])
    model = model_of(mesh, BRAIN, loads=[force])
    simulator = Simulator(System(model, device), tolerance=1e-14)
    for _ in range(10):
        simulator.step()
    # sum of h F(t_k) with t_k at the ends of ten steps: 5.5 of 10
    expected = 0.001 * 5.5 / model.mass
    # the loads are shared evenly and the masses are even: no strain
    np.testing.assert_allclose(simulator.v.numpy()[:, 0], expected, rtol=1e-11)


def test_check_says_what_turned_inside_out(device: str) -> None:
    mesh = beam()
    top = mesh.points[:, 2] > 0.1 - 1e-9
    mesh = TetMesh(mesh.points, mesh.tetrahedra, node_sets={"top": top})
    model = model_of(
        mesh,
        BRAIN,
        constrained=np.repeat(mesh.points[:, 2:] < 1e-12, 3, axis=1),
        loads=[NodalForce(nodes="top", total=(0.0, 0.0, -5e4))],
    )
    simulator = Simulator(System(model, device))
    simulator.step()
    with pytest.raises(SolveError, match=r"element \d+ at \(.*\) mm, tissue 1, turned inside out by 1 ms \(J = -"):
        simulator.check()


def test_check_says_that_cg_did_not_converge(device: str) -> None:
    simulator = Simulator(System(clamped_beam(loads=[FALL]), device), max_cg=2, tolerance=1e-12)
    simulator.step()
    with pytest.raises(SolveError, match=r"did not converge in the step to 1 ms: residual .* after 2 iterations"):
        simulator.check()


def test_check_says_that_the_motion_is_not_finite(device: str) -> None:
    simulator = Simulator(System(clamped_beam(loads=[FALL]), device), max_cg=20)
    v = np.zeros((simulator.system.size, 3))
    v[-1] = np.nan
    simulator.v.assign(v)
    simulator.step()
    with pytest.raises(SolveError, match="the motion is not finite after 1 ms"):
        simulator.check()


def test_captured_step_is_the_step(device: str) -> None:
    """A graph replays the same arithmetic, loads that change and all."""
    ends = []
    for captured in (False, True):
        load = Gravity(direction=(0.0, 0.0, -1.0), density=1211.5, ramp=[(0.0, 0.0), (0.01, 1.0)])
        system = System(clamped_beam(loads=[load]), device)
        simulator = Simulator(system)
        if captured:
            simulator.capture()
        for _ in range(20):
            simulator.step()
        simulator.check()
        ends.append(system.u.numpy())
    assert np.array_equal(ends[0], ends[1])


def test_captured_step_follows_a_moving_clamp(device: str) -> None:
    """The clamp may begin to move after the capture."""
    ends = []
    for captured in (False, True):
        system = System(clamped_beam(), device)
        simulator = Simulator(system)
        if captured:
            simulator.capture()
        for step in range(1, 6):
            simulator.prescribe(np.where(system.model.constrained, [0.0005 * step, 0.0, 0.0], 0.0))
            simulator.step()
        ends.append(system.u.numpy())
    assert np.abs(ends[1] - ends[0]).max() <= 1e-12
