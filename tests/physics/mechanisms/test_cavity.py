"""A cavity that opens: what is taken out weighs nothing, and what comes back is as it was."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import model_of
from shapes import box

from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.cavity import Cavity
from warpbrain.physics.mechanisms.gravity import STANDARD_GRAVITY, Gravity
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver, solve_equilibrium
from warpbrain.simulation.model import Damping, Material, Model
from warpbrain.simulation.system import System

DENSITY = 1000.0
#: The upper half of a column that stands on its foot is taken out.
COLUMN = box((2, 2, 4), (0.02, 0.02, 0.04))
UPPER = COLUMN.points[COLUMN.tetrahedra].mean(axis=1)[:, 2] > 0.02
MESH = replace(COLUMN, element_sets={"upper": UPPER})
FOOT = np.repeat(COLUMN.points[:, 2:] < 1e-9, 3, axis=1)
WEIGHT = Gravity(direction=(0.0, 0.0, -1.0), density=DENSITY)
SOFT = Material(NeoHookean(1000.0), 0.4)


def column(**cavity) -> Model:
    taken = Cavity(elements="upper", **cavity)
    options = {"constrained": FOOT, "density": DENSITY, "damping": Damping(0.02, 0.0)}
    return model_of(MESH, SOFT, loads=(WEIGHT,), mechanisms=(taken,), **options)


def test_what_is_taken_out_weighs_nothing(device):
    model = column()
    state = solve_equilibrium(System(model, device))
    carried = (state.internal - model.external_forces())[FOOT.all(axis=1), 2].sum()
    half = DENSITY * STANDARD_GRAVITY * 0.5 * MESH.volume
    assert carried == pytest.approx((1.0 + Cavity().left) * half, rel=1e-6)
    # and the rest stands as if the upper half had never been
    left, nodes, _ = MESH.without(UPPER)
    alone = model_of(left, SOFT, loads=(WEIGHT,), constrained=FOOT[nodes], density=DENSITY)
    expected = solve_equilibrium(System(alone, device)).u
    assert np.abs(state.u[nodes] - expected).max() < 2e-3 * np.abs(expected).max()


def test_its_mass_goes_with_it(device):
    simulator = Simulator(System(column(ramp=((0.0, 0.0), (0.002, 1.0))), device), time_step=1e-3)
    whole = DENSITY * MESH.volume
    masses = [simulator.system.mass.numpy().sum()]
    for _ in range(3):
        simulator.step()
        masses.append(simulator.system.mass.numpy().sum())
    gone = 0.5 * (1.0 - Cavity().left)
    np.testing.assert_allclose(masses, whole * (1.0 - gone * np.array([0.5, 0.5, 1.0, 1.0])), rtol=1e-12)


def test_tissue_that_is_put_back_is_as_it_was(device):
    """The bar of two tissues in series, stretched: the stiff one is taken out and comes back."""
    bar = box((1, 1, 4), (0.5, 0.5, 2.0))
    z = bar.points[:, 2]
    upper = bar.points[bar.tetrahedra].mean(axis=1)[:, 2] > 1.0
    mesh = replace(bar, tissue=np.where(upper, 2, 1), element_sets={"upper": upper})
    constrained = np.ones(mesh.points.shape, dtype=bool)
    constrained[:, 2] = (z < 1e-12) | (z > 2.0 - 1e-12)
    prescribed = np.where((z > 2.0 - 1e-12)[:, None], [0.0, 0.0, 0.1], 0.0)
    materials = [Material(NeoHookean(mu), 0.45, "uncoupled") for mu in (1000.0, 3000.0)]
    start, states, stretches = None, [], []
    for scale in (0.0, 1.0, 0.0):
        taken = Cavity(elements="upper", ramp=((0.0, scale),))
        model = model_of(mesh, *materials, constrained=constrained, prescribed=prescribed, mechanisms=(taken,))
        system = System(model, device)
        start = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-12)).solve(start=start).u
        states.append(start)
        stretches.append(system.deformation_gradients()[:, 2, 2])
    np.testing.assert_allclose(stretches[0][~upper], 1.07511932, rtol=1e-8)
    # nothing pulls any more but what is left of the stiff part, 1e-4 of it
    assert np.abs(stretches[1][~upper] - 1.0).max() < 1e-4
    assert np.abs(states[2] - states[0]).max() <= 1e-10


def test_a_cavity_that_opens_and_closes_in_motion_leaves_no_trace(device):
    ramp = ((0.0, 0.0), (0.01, 0.0), (0.03, 1.0), (0.04, 1.0), (0.06, 0.0))
    system = System(column(ramp=ramp), device)
    expected = solve_equilibrium(system, EquilibriumOptions(tolerance=1e-10)).u
    simulator = Simulator(system, time_step=2e-3, tolerance=1e-10)
    simulator.reset()
    simulator.restore(expected, np.zeros_like(expected), 0.0)
    farthest = 0.0
    for step in range(300):
        if step == 60:
            # all is open and closed again: what is left comes to rest in long steps
            simulator.set_time_step(0.05)
        simulator.step()
        farthest = max(farthest, float(np.abs(system.u.numpy() - expected).max()))
    assert farthest > 0.2 * np.abs(expected).max()
    assert np.abs(system.u.numpy() - expected).max() < 1e-6 * np.abs(expected).max()
