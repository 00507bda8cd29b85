"""Drainage: one step of it, what it keeps, and what is left when all has flowed."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import energy_at, forces_at, model_of
from shapes import box, cube, distorted

from warpbrain.errors import InputError, SolveError
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.load import NodalForce
from warpbrain.physics.mechanism import Facts, ParameterError
from warpbrain.physics.mechanisms.drainage import Drainage, DrainageTerm
from warpbrain.physics.proposal import Situation
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.quasi_static import follow_slowly
from warpbrain.simulation.sensitivity import SensitivitySolver
from warpbrain.simulation.system import System

MU = 1000.0
#: With all there is, and with nothing but what must be there.
FLUIDS = {
    "all": {"storage": 1e-5, "pressure": 100.0, "exchange": 1e-3, "capillary_pressure": 300.0},
    "one face": {"drained": "top"},
    "a half": {"elements": "half", "pressure": 50.0},
}


def body() -> TetMesh:
    mesh = distorted(cube(3), 0.05, tissues=2)
    middles = mesh.points[mesh.tetrahedra].mean(axis=1)
    return replace(mesh, node_sets={"top": mesh.points[:, 2] > 0.9}, element_sets={"half": middles[:, 0] > 0.4})


def system_of(fluid: Drainage, device: str = "cpu", precision: str = "double") -> System:
    materials = Material(NeoHookean(MU)), Material(NeoHookean(0.5 * MU), 0.4, "uncoupled")
    return System(model_of(body(), *materials, mechanisms=(fluid,)), device, precision)


def term_of(system: System) -> DrainageTerm:
    [term] = [term for term in system.terms if isinstance(term, DrainageTerm)]
    return term


def moved(seed: int, size: int) -> np.ndarray:
    return 0.03 * np.random.default_rng(seed).uniform(-1.0, 1.0, (size, 3))


@pytest.mark.parametrize("h", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("kind", FLUIDS)
def test_a_step_has_a_potential_and_its_tangent_holds_what_the_pressure_does(kind, h, device):
    system = system_of(Drainage(permeability=1e-5, **FLUIDS[kind]), device)
    term = term_of(system)
    term.set_time_step(h)
    system.u.assign(moved(0, system.size))
    term.advance(system.u)
    u, d = moved(1, system.size), np.random.default_rng(2).normal(size=(system.size, 3))
    step = 1e-5
    slope = (energy_at(system, u + step * d) - energy_at(system, u - step * d)) / (2.0 * step)
    assert np.vdot(forces_at(system, u), d) == pytest.approx(slope, rel=1e-6)
    change = (forces_at(system, u + step * d) - forces_at(system, u - step * d)) / (2.0 * step)
    system.u.assign(u)
    system.evaluate_tangents()
    assert np.abs(system.stiffness_times(d) - change).max() <= 1e-6 * np.abs(change).max()


def test_single_precision_agrees_with_double_over_steps(device):
    found = []
    for precision in ("single", "double"):
        system = system_of(Drainage(permeability=1e-5, **FLUIDS["all"]), device, precision)
        term_of(system).set_time_step(1.0)
        for seed in range(3):
            forces = forces_at(system, moved(seed, system.size))
            term_of(system).advance(system.u)
        found.append(forces)
    assert np.abs(found[0] - found[1]).max() <= 1e-4 * np.abs(found[1]).max()


def squeezed(fluid: Drainage, material: Material | None = None, **options) -> Model:
    """A cube on a table, pressed on at the half of its upper face."""
    mesh = cube(4)
    x, _, z = mesh.points.T
    mesh = replace(mesh, node_sets={"table": z < 1e-9, "pressed": (z > 1.0 - 1e-9) & (x < 0.6)})
    constrained = np.repeat((z < 1e-9)[:, None], 3, axis=1)
    loads = (NodalForce(nodes="pressed", total=(10.0, 0.0, -100.0)),)
    return model_of(
        mesh, material or Material(NeoHookean(MU), 0.3), constrained=constrained, loads=loads, mechanisms=(fluid,),
        **options,
    )  # fmt: skip


def volume_of(system: System) -> float:
    """Of the deformed body beyond that of the reference [m3]."""
    return float((np.linalg.det(system.deformation_gradients()) - 1.0) @ system.model.mesh.volumes)


def test_no_fluid_is_lost():
    """Of a sealed body: what its volume and storage gain is what came out of the blood vessels, to the last digits."""
    exchange, capillary, storage = 1e-6, 200.0, 1e-4
    model = squeezed(Drainage(permeability=1e-8, exchange=exchange, capillary_pressure=capillary, storage=storage))
    nothing = np.zeros(len(model.mesh.points), dtype=bool)
    mesh = replace(model.mesh, node_sets={**model.mesh.node_sets, "none": nothing})
    fluid = replace(model.mechanisms[0], drained="none")
    system = System(replace(model, mesh=mesh, mechanisms=(fluid,)), "cpu")
    held, now, came_in = 0.0, 0.0, 0.0
    for moment in follow_slowly(system, [0.1, 1.0, 30.0, 1000.0]):
        integral = float(term_of(system).pressures() @ mesh.node_volumes)
        came_in += (moment.time - now) * exchange * (capillary * mesh.volume - integral)
        system.u.assign(moment.state.u)
        held, now = volume_of(system) + storage * integral, moment.time
        assert held == pytest.approx(came_in, abs=1e-10)
    assert abs(held) > 0.01


def test_in_the_end_the_skeleton_carries_the_load_alone():
    model = squeezed(Drainage(permeability=1e-8, drained="table"))
    alone = solve_equilibrium(System(replace(model, mechanisms=()), "cpu")).u
    assert np.abs(solve_equilibrium(System(model, "cpu")).u - alone).max() < 1e-9
    moments = list(follow_slowly(System(model, "cpu"), [1.0, 1e3, 1e6, 1e9]))
    assert np.abs(moments[0].state.u - alone).max() > 0.1 * np.abs(alone).max()
    assert np.abs(moments[-1].state.u - alone).max() < 1e-6 * np.abs(alone).max()


@pytest.mark.parametrize("part", [0.9, -3.0])
def test_a_course_that_is_near_changes_nothing_but_the_way(part: float):
    """However far away it is: the states are equilibria, and a search that ends nowhere begins once more without it."""
    times, options = [1.0, 10.0, 100.0, 1000.0], EquilibriumOptions(tolerance=1e-9)
    model = squeezed(Drainage(permeability=1e-8, drained="table"))
    alone = [moment.state for moment in follow_slowly(System(model, "cpu"), times, options)]
    near = [part * state.u for state in alone]
    beside = [moment.state for moment in follow_slowly(System(model, "cpu"), times, options, near=near)]
    size = np.abs(alone[-1].u).max()
    assert max(np.abs(a.u - b.u).max() for a, b in zip(alone, beside, strict=True)) < 1e-6 * size
    if part > 0.0:
        assert sum(len(state.history) for state in beside) < sum(len(state.history) for state in alone)


def test_exchange_and_flow_come_to_balance():
    """`k p'' = k_c (p - p_c)` in a column drained at its top: `p = p_c (1 - cosh(z/l) / cosh(1/l))`."""
    mesh = box((1, 1, 32), (1.0 / 32, 1.0 / 32, 1.0))
    z = mesh.points[:, 2]
    mesh = replace(mesh, node_sets={"top": z > 1.0 - 1e-9})
    constrained = np.ones(mesh.points.shape, dtype=bool)
    constrained[:, 2] = z < 1e-9
    fluid = Drainage(permeability=1e-9, drained="top", exchange=9e-9, capillary_pressure=0.01)
    system = System(model_of(mesh, Material(NeoHookean(MU), 0.2), constrained=constrained, mechanisms=(fluid,)), "cpu")
    solve_equilibrium(system)
    expected = 0.01 * (1.0 - np.cosh(3.0 * z) / np.cosh(3.0))
    assert np.abs(term_of(system).pressures() - expected).max() < 2e-3 * 0.01


def test_a_steady_flow_is_that_of_the_deformed_body():
    """Where much fluid is exchanged the equilibrium is what very long steps come to, which know the shape before."""
    fluid = Drainage(permeability=1e-9, exchange=1e-8, capillary_pressure=1500.0)
    at_once = solve_equilibrium(System(squeezed(fluid), "cpu")).u
    for moment in follow_slowly(System(squeezed(fluid), "cpu"), [1e3, 1e6, *(1e9 * np.arange(1, 6))]):
        slowly = moment.state.u
    assert np.abs(at_once - slowly).max() < 1e-6 * np.abs(at_once).max()


def test_a_captured_step_is_the_same_step(device):
    models = [squeezed(Drainage(permeability=1e-8), density=1000.0) for _ in range(2)]
    found = []
    for model, captured in zip(models, (False, True), strict=True):
        system = System(model, device)
        simulator = Simulator(system, time_step=0.01, tolerance=1e-8)
        if captured:
            simulator.capture()
        for _ in range(5):
            simulator.step()
        assert simulator.check() > 0.0
        found.append(system.u.numpy().copy())
    assert np.abs(found[0]).max() > 0.0
    assert np.abs(found[1] - found[0]).max() < 1e-6 * np.abs(found[0]).max()


@pytest.mark.slow(3)
def test_a_step_that_is_too_long_is_halved_and_what_no_step_reaches_is_said():
    system = System(squeezed(Drainage(permeability=1e-8)), "cpu")
    with pytest.raises(InputError, match="increase"):
        next(follow_slowly(system, [2.0, 1.0]))
    mad = squeezed(Drainage(permeability=1e-8))
    mad = replace(mad, loads=(NodalForce(nodes="pressed", total=(0.0, 0.0, 1e6)),))
    with pytest.raises(SolveError, match="no equilibrium found"):
        next(follow_slowly(System(mad, "cpu"), [1.0], EquilibriumOptions(max_newton=2, max_total_newton=2)))


def test_what_was_measured_in_brain_is_expected_and_looked_for():
    expected = Drainage.parameters()["permeability"].expectation
    assert expected.quantile(0.025) < 1e-14 and expected.quantile(0.975) > 1e-11
    mesh = cube(2)
    sites = mesh.centres[:1]
    situation = Situation(
        mesh, None, 1000.0, 0.4, frozenset(), frozenset(("neo-hookean",)), (), (), 3, sites, sites, 0.05
    )
    places = [(float(one.mean[0]), float(one.sd[0])) for one in Drainage.proposals(situation)]
    for permeability in np.geomspace(1e-14, 1e-11, 7):
        assert min(abs(np.log(permeability) - mean) / sd for mean, sd in places) < 1.0


def test_fluid_that_could_never_leave_is_refused():
    mesh = body()
    mesh = replace(mesh, node_sets={"top": mesh.node_sets["top"], "one": np.arange(len(mesh.points)) == 0})
    with pytest.raises(ParameterError, match="could not leave") as caught:
        Drainage.of_case({"permeability": 1e-9, "drained": "one"}, Facts(mesh))
    assert caught.value.key == "drained"
    Drainage.of_case({"permeability": 1e-9, "drained": "one", "exchange": 1e-6}, Facts(mesh))


def test_a_step_in_which_fluid_flows_has_no_sensitivities_yet():
    system = System(squeezed(Drainage(permeability=1e-8)), "cpu")
    [moment] = follow_slowly(system, [1.0])
    with pytest.raises(SolveError, match="fluid flows"):
        SensitivitySolver(system).solve(moment.state.u, lambda theta: {1: Material(NeoHookean(theta[0]), 0.3)}, [MU])
