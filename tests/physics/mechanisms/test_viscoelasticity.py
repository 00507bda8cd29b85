"""Viscoelasticity against the hereditary integral, by quadrature."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import energy_at, forces_at, model_of
from scipy.integrate import quad
from scipy.stats import norm
from shapes import cube

from warpbrain.errors import InputError
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.model import Damping, Material, Model
from warpbrain.simulation.quasi_static import follow_slowly
from warpbrain.simulation.system import System

MU = 700.0
MODULI, TIMES = (2.0, 0.5), (0.3, 4.0)


def system_of(*mechanisms: Viscoelasticity, **options) -> System:
    return System(model_of(cube(1), Material(NeoHookean(MU)), mechanisms=mechanisms, **options), "cpu")


def gradient(strain: float) -> np.ndarray:
    """A shear with some change of volume."""
    return np.eye(3) + strain * np.array([[0.3, 1.0, 0.0], [0.0, -0.1, 0.0], [0.0, 0.2, 0.1]])


def isochoric(F: np.ndarray) -> np.ndarray:
    C = F.T @ F
    return MU * np.linalg.det(F) ** (-2.0 / 3.0) * (np.eye(3) - np.trace(C) / 3.0 * np.linalg.inv(C))


def stress_over(times: np.ndarray, strains: np.ndarray) -> np.ndarray:
    """What viscosity adds to the first Piola-Kirchhoff stress of a cube, after each step: the virial of its nodes."""
    plain, system = system_of(), system_of(Viscoelasticity(moduli=MODULI, times=TIMES))
    mesh = system.model.mesh
    found = []
    for h, strain in zip(np.diff(times), strains[1:], strict=True):
        u = mesh.points @ (gradient(strain) - np.eye(3)).T
        for term in system.terms:
            term.set_time_step(h)
        forces = forces_at(system, u) - forces_at(plain, u)
        found.append(forces.T @ mesh.points / mesh.volume)
        for term in system.terms:
            term.advance(system.u)
    return np.array(found)


def integral(time: float, strain, rate) -> np.ndarray:
    """`F sum_i beta_i int_0^t exp(-(t - s)/tau_i) dS/ds ds`, component by component."""

    def component(i: int, j: int) -> float:
        def integrand(s: float) -> float:
            h = 1e-5
            slope = (isochoric(gradient(strain(s) + h)) - isochoric(gradient(strain(s) - h)))[i, j] / (2.0 * h)
            fading = sum(b * np.exp(-(time - s) / tau) for b, tau in zip(MODULI, TIMES, strict=True))
            return float(fading * slope * rate(s))

        return quad(integrand, 0.0, time, epsabs=1e-9, epsrel=1e-9, limit=200, points=[min(0.5, time)])[0]

    return gradient(strain(time)) @ np.array([[component(i, j) for j in range(3)] for i in range(3)])


def ramp_and_hold(t: float) -> float:
    return 0.2 * min(t / 0.5, 1.0)


@pytest.mark.parametrize(
    ("strain", "rate"),
    [
        (ramp_and_hold, lambda t: 0.4 if t < 0.5 else 0.0),
        (lambda t: 0.2 * np.sin(3.0 * t), lambda t: 0.6 * np.cos(3.0 * t)),
    ],
    ids=["relaxation", "hysteresis"],
)
def test_stress_is_the_hereditary_integral_to_second_order(strain, rate):
    errors = []
    expected = integral(2.0, strain, rate)
    for steps in (40, 80):
        times = np.linspace(0.0, 2.0, steps + 1)
        found = stress_over(times, np.array([strain(t) for t in times]))
        errors.append(np.abs(found[-1] - expected).max() / np.abs(expected).max())
    assert errors[1] < 3e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=1e-3)


def test_a_step_has_a_potential_and_its_tangent_is_the_slope_of_its_forces():
    system = system_of(Viscoelasticity(moduli=MODULI, times=TIMES))
    random = np.random.default_rng(0)
    u, d = (0.1 * random.uniform(-1.0, 1.0, (system.size, 3)) for _ in range(2))
    [term] = system.terms
    term.set_time_step(0.1)
    system.u.assign(0.5 * u)
    term.advance(system.u)
    h = 1e-5
    slope = (energy_at(system, u + h * d) - energy_at(system, u - h * d)) / (2.0 * h)
    assert np.vdot(forces_at(system, u), d) == pytest.approx(slope, rel=1e-7)
    change = (forces_at(system, u + h * d) - forces_at(system, u - h * d)) / (2.0 * h)
    system.u.assign(u)
    system.evaluate_tangents()
    assert np.abs(system.stiffness_times(d) - change).max() <= 1e-7 * np.abs(change).max()


def test_forces_of_a_step_are_the_slope_of_its_potential():
    """With a memory; in an equilibrium, where everything has relaxed, there is none."""
    plain, system = system_of(), system_of(Viscoelasticity(moduli=MODULI, times=TIMES))
    random = np.random.default_rng(0)
    u, d = (0.1 * random.uniform(-1.0, 1.0, (system.size, 3)) for _ in range(2))
    [term] = system.terms
    term.set_time_step(np.inf)
    assert energy_at(system, u) == energy_at(plain, u)
    term.set_time_step(0.1)
    for before in (0.5 * u, 0.8 * u):
        system.u.assign(before)
        term.advance(system.u)
    h = 1e-5
    slope = (energy_at(system, u + h * d) - energy_at(system, u - h * d)) / (2.0 * h)
    assert np.vdot(forces_at(system, u), d) == pytest.approx(slope, rel=1e-8)


def held() -> Model:
    """A cube on a table, its top pulled sideways."""
    mesh = cube(2)
    low, high = mesh.points[:, 2] < 1e-9, mesh.points[:, 2] > 1.0 - 1e-9
    constrained = np.repeat((low | high)[:, None], 3, axis=1)
    prescribed = np.where(high[:, None], [0.1, 0.0, 0.05], 0.0)
    return model_of(mesh, Material(NeoHookean(MU)), constrained=constrained, prescribed=prescribed, density=1.0)


def test_motion_relaxes_to_the_equilibrium_without_viscosity():
    model = replace(held(), mechanisms=(Viscoelasticity(moduli=(3.0,), times=(0.05,)),))
    expected = solve_equilibrium(System(held(), "cpu"))
    assert np.abs(solve_equilibrium(System(model, "cpu")).u - expected.u).max() < 1e-9
    system = System(model, "cpu")
    simulator = Simulator(system, time_step=0.01)
    simulator.prescribe(model.prescribed)
    reactions = []
    for _ in range(60):
        simulator.step()
        system.evaluate_forces()
        system.gather_forces()
        reactions.append(system.internal.numpy()[model.prescribed[:, 0] > 0.0].sum(axis=0)[0])
    assert reactions[0] > 2.5 * reactions[-1]
    top = expected.internal[model.prescribed[:, 0] > 0.0].sum(axis=0)[0]
    assert reactions[-1] == pytest.approx(top, rel=1e-3)
    assert np.abs(system.u.numpy() - expected.u).max() < 1e-4


@pytest.mark.parametrize(("moduli", "times"), [((1.0,), ()), ((0.0,), (1.0,)), ((1.0,), (-1.0,))])
def test_branches_that_make_no_sense(moduli, times):
    with pytest.raises(InputError, match="expected"):
        Viscoelasticity(moduli=moduli, times=times)


def test_slow_change_relaxes_as_motion_does():
    """Without inertia: the reactions of equilibria at the same times are those of light tissue in motion."""
    model = replace(held(), density=1e-6, damping=Damping(0.0, 0.0))
    model = replace(model, mechanisms=(Viscoelasticity(moduli=(3.0,), times=(5.0,)),))
    top, times = model.prescribed[:, 0] > 0.0, 0.5 * np.arange(1, 9)
    slow = System(model, "cpu")
    expected = [moment.state.internal[top, 0].sum() for moment in follow_slowly(slow, times.tolist())]
    system = System(model, "cpu")
    simulator = Simulator(system, time_step=0.5, newton=6, tolerance=1e-10)
    simulator.prescribe(model.prescribed)
    for reaction in expected:
        simulator.step()
        system.evaluate_forces()
        system.gather_forces()
        assert system.internal.numpy()[top, 0].sum() == pytest.approx(reaction, rel=1e-5)
    # nothing but a look at it: the memory is that of the step
    slow.evaluate_forces()
    slow.gather_forces()
    assert slow.internal.numpy()[top, 0].sum() == pytest.approx(expected[-1], rel=1e-9)


def test_no_relaxation_time_is_more_probable_than_another_within_those_that_are_looked_for():
    """Of one branch: the density of `ln tau` under all proposals together."""
    situation = SimpleNamespace(require_new=lambda _kind: None, instants=3)
    alone = [proposal for proposal in Viscoelasticity.proposals(situation) if len(proposal) == 2]
    log_times = np.linspace(math.log(1.0), math.log(300.0), 200)
    density = sum(norm.pdf(log_times, proposal.mean[1], proposal.sd[1]) for proposal in alone) / len(alone)
    assert density[10:-10].max() < 1.5 * density[10:-10].min()
    # a size says how much relaxes, not how fast
    [scaled] = {tuple(proposal.scales(0.1)) for proposal in alone}
    assert scaled == (0.1, 1.0)
