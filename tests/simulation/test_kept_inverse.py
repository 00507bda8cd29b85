"""The inverse of a state near by, on a GPU: it finds what the captured loop finds, in fewer iterations."""

import numpy as np
import warp as wp
from bodies import model_of
from shapes import cube

from warpbrain.kernels.linear import ConjugateGradient
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation import kept_inverse as module
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.factored import KeptFactors
from warpbrain.simulation.kept_inverse import InvertedSolver, KeptInverse, kept_for
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System


def body(modulus: float = 1000.0, pressed: float = 0.1) -> Model:
    """A cube that stands on its base and is pressed from above."""
    mesh = cube(5)
    z = mesh.points[:, 2]
    below, above = z == 0.0, z == 1.0
    prescribed = np.zeros_like(mesh.points)
    prescribed[above, 2] = -pressed
    held = np.repeat((below | above)[:, None], 3, axis=1)
    return model_of(mesh, Material(NeoHookean(modulus), 0.45), constrained=held, prescribed=prescribed)


def equilibrium(model: Model, device: str, kept: KeptFactors | None) -> tuple[np.ndarray, list[int]]:
    """Displacement, and iterations of each linear system."""
    system = System(model, device)
    found = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-8), factors=kept).solve()
    return found.u, [step.cg_iterations for step in found.history]


def test_factors_are_kept_on_a_cpu_and_used_where_fluid_flows():
    kept = kept_for(wp.get_device("cpu"))
    assert type(kept) is KeptFactors
    system = System(body(), "cpu")
    assert isinstance(system.linear_solver(tolerance=1e-3, max_iterations=100, factors=kept), ConjugateGradient)


def test_single_precision_is_for_the_captured_loop():
    system = System(body(), "cpu", "single")
    kept = KeptInverse(wp.get_device("cpu"))
    assert isinstance(system.linear_solver(tolerance=1e-3, max_iterations=100, factors=kept), ConjugateGradient)


def test_it_finds_the_same_in_fewer_iterations(gpu):
    kept = kept_for(gpu)
    assert isinstance(kept, KeptInverse)
    for modulus, pressed in ((1000.0, 0.1), (1100.0, 0.12), (3000.0, 0.05)):
        expected, many = equilibrium(body(modulus, pressed), gpu.alias, None)
        found, few = equilibrium(body(modulus, pressed), gpu.alias, kept)
        np.testing.assert_allclose(found, expected, atol=1e-7)
        assert sum(few) < sum(many) / 2
    inverse = kept._factors
    equilibrium(body(1000.0, 0.11), gpu.alias, kept)
    assert kept._factors is inverse


def test_other_free_components_have_another_inverse(gpu):
    kept = kept_for(gpu)
    equilibrium(body(), gpu.alias, kept)
    before = kept._factors
    model = body()
    held = model.constrained.copy()
    held[model.mesh.points[:, 0] == 0.0] = True
    other = model_of(model.mesh, *model.materials.values(), constrained=held, prescribed=model.prescribed)
    found, _ = equilibrium(other, gpu.alias, kept)
    assert kept._factors is not before
    np.testing.assert_allclose(found, equilibrium(other, gpu.alias, None)[0], atol=1e-7)


def test_without_memory_the_captured_loop_solves(gpu, monkeypatch):
    monkeypatch.setattr(module, "_MATRICES", 10**12)
    kept = kept_for(gpu)
    found, iterations = equilibrium(body(), gpu.alias, kept)
    expected, many = equilibrium(body(), gpu.alias, None)
    np.testing.assert_array_equal(found, expected)
    assert iterations == many and kept._factors is None


def test_an_unstable_state_is_told(gpu):
    system = System(body(), gpu.alias)
    system.evaluate_tangents()
    system.assemble(-1.0, 0.0)
    system.load.assign(np.random.default_rng(0).normal(size=(system.size, 3)) * ~system.model.constrained)
    solver = system.linear_solver(tolerance=1e-6, max_iterations=500, watch_curvature=True, factors=kept_for(gpu))
    assert isinstance(solver, InvertedSolver)
    solver.prepare()
    system.solution.zero_()
    solver.solve()
    assert solver.result().indefinite
