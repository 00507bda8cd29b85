"""Static equilibrium: convergence, load steps, mixtures of tissues, and how a failure is told."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bodies import energy_at, forces_at, model_of
from material_point import LAWS, MATERIALS, stress_at
from scipy.optimize import brentq, minimize_scalar
from shapes import box, cube, distorted
from verification_rows import Row

from warpbrain.errors import InputError, SolveError
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean, Ogden
from warpbrain.physics.load import NodalForce
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.residual_stress import ResidualStress
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver, NewtonStep, solve_equilibrium
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.relaxation import RelaxationOptions, relax_to_rest
from warpbrain.simulation.system import System

BRAIN = Material(LAWS["neo-hookean"])
every_material = pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS.keys())


def stretched(material: Material, amount: float, n: int = 4) -> Model:
    """The unit cube, clamped below, its top moved up."""
    mesh = cube(n)
    z = mesh.points[:, 2]
    low, high = z < 1e-12, z > 1.0 - 1e-12
    prescribed = np.zeros(mesh.points.shape)
    prescribed[high, 2] = amount
    constrained = np.repeat((low | high)[:, None], 3, axis=1)
    return model_of(mesh, material, constrained=constrained, prescribed=prescribed)


def pushed(material: Material, force: float, n: int = 2) -> Model:
    """A 5 cm cube, clamped below, a vertical force [N] on the nodes of its top."""
    mesh = box((n, n, n), (0.05, 0.05, 0.05))
    z = mesh.points[:, 2]
    mesh = TetMesh(mesh.points, mesh.tetrahedra, node_sets={"top": z > 0.05 - 1e-9})
    clamped = np.repeat(z[:, None] < 1e-12, 3, axis=1)
    return model_of(mesh, material, constrained=clamped, loads=[NodalForce(nodes="top", total=(0.0, 0.0, force))])


# -- convergence --------------------------------------------------------------------------------------------------


@every_material
def test_a_stretch_of_20_percent_in_one_step(material: Material, device: str) -> None:
    """At most 6 iterations, the elements never inside out, and Newton's quadratic end."""
    seen: list[NewtonStep] = []
    system = System(stretched(material, 0.2), device)
    found = solve_equilibrium(system, EquilibriumOptions(tolerance=1e-9), seen.append)
    assert tuple(seen) == found.history
    assert {step.load for step in found.history} == {1.0}
    assert len(found.history) <= 6
    assert all(step.min_J > 0.0 for step in found.history)
    assert all(step.step == 1.0 for step in found.history)
    assert found.residual <= 1e-9
    np.testing.assert_array_equal(found.u[system.model.constrained], system.model.prescribed[system.model.constrained])
    # what is returned is the state of the system
    assert energy_at(system, found.u) == pytest.approx(found.energy, rel=1e-12)
    free = ~system.model.constrained
    assert np.linalg.norm(found.internal[free]) <= 1e-9 * np.linalg.norm(found.internal)
    assert np.abs(found.internal.sum(axis=0)).max() <= 1e-9 * np.abs(found.internal).max()


def test_nothing_to_do(device: str) -> None:
    mesh = cube(2)
    clamped = np.repeat(mesh.points[:, 2:] < 1e-12, 3, axis=1)
    for name in LAWS:
        found = solve_equilibrium(System(model_of(mesh, Material(LAWS[name]), constrained=clamped), device))
        assert np.abs(found.u).max() <= 1e-12
        assert found.energy == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("force", [-2.0, 2.0])
@pytest.mark.parametrize("name", ["neo-hookean", "mooney-rivlin", "ogden -4.7"])
def test_reaction_balances_the_load(name: str, force: float, device: str) -> None:
    """Great strains: the cube is squeezed or drawn by 20 % and more."""
    system = System(pushed(Material(LAWS[name]), force), device)
    found = solve_equilibrium(system)
    clamp = system.model.constrained[:, 0]
    np.testing.assert_allclose(found.internal[clamp].sum(axis=0), [0.0, 0.0, -force], atol=1e-6 * abs(force))
    assert all(step.min_J > 0.0 for step in found.history)
    assert abs(found.u[:, 2]).max() > 0.01


def test_load_is_cut_and_grows_again(device: str) -> None:
    """What Newton cannot reach at once it reaches in steps, and the end does not depend on the steps."""
    model = stretched(Material(LAWS["ogden -20"], 0.45, "uncoupled"), -0.35, n=3)
    system = System(model, device)
    found = solve_equilibrium(system, EquilibriumOptions(max_newton=6))
    loads = [step.load for step in found.history]
    assert min(loads) < 1.0
    assert loads[-1] == 1.0
    patient = solve_equilibrium(System(model, device), EquilibriumOptions(max_newton=60))
    assert np.abs(found.u - patient.u).max() <= 1e-7


def test_solver_starts_where_it_is_told(device: str) -> None:
    system = System(pushed(BRAIN, -1.0), device)
    solver = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-10))
    first = solver.solve()
    again = solver.solve(start=first.u)
    assert len(again.history) == 0
    assert np.array_equal(again.u, first.u)
    other = solver.solve(external=2.0 * system.model.external_forces(), start=first.u)
    expected = solve_equilibrium(System(pushed(BRAIN, -2.0), device), EquilibriumOptions(tolerance=1e-10))
    assert np.abs(other.u - expected.u).max() <= 1e-8 * np.abs(expected.u).max()


def test_from_a_start_its_branch_is_gone_along(device: str) -> None:
    """What cannot be reached at once: in steps from the load that holds the start, not from a part of the whole one."""
    system = System(pushed(BRAIN, -2.0), device)
    full = system.model.external_forces()
    start = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-10)).solve(external=-0.5 * full).u
    impatient = EquilibriumOptions(tolerance=1e-10, max_newton=8)
    found = EquilibriumSolver(system, impatient).solve(start=start)
    loads = [step.load for step in found.history]
    assert min(loads) < 1.0
    expected = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-10)).solve()
    assert np.abs(found.u - expected.u).max() <= 1e-8 * np.abs(expected.u).max()


def test_iterations_that_must_contract(device: str) -> None:
    """From nearby they find the same; from far away they end at once, where others go on to wherever they come to."""
    system = System(pushed(BRAIN, -2.0), device)
    expected = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-10)).solve()
    contracting = EquilibriumSolver(
        system, EquilibriumOptions(tolerance=1e-10, contracts=True, min_load_step=1.0, pass_unstable=False)
    )
    found = contracting.solve(start=0.9 * expected.u)
    assert np.abs(found.u - expected.u).max() <= 1e-8 * np.abs(expected.u).max()
    far = -2.0 * expected.u
    assert any(step.step < 1.0 for step in EquilibriumSolver(system).solve(start=far).history)
    with pytest.raises(SolveError, match=r"after 0 Newton iterations.*a whole step of Newton's method leads too far"):
        contracting.solve(start=far)


def test_same_bits_every_time(device: str, precision) -> None:
    one, other = (
        solve_equilibrium(System(stretched(MATERIALS["ogden -4.7, coupled"], 0.2), device, precision.name))
        for _ in range(2)
    )
    assert np.array_equal(one.u, other.u)
    assert np.array_equal(one.internal, other.internal)
    assert one.history == other.history


@every_material
def test_single_agrees_with_double(material: Material, device: str) -> None:
    double, single = (solve_equilibrium(System(stretched(material, 0.2), device, p)) for p in ("double", "single"))
    # a residual of 6e-6 (50 roundings) times the condition of the problem, some ten
    assert np.abs(single.u - double.u).max() <= 1e-4 * 0.2
    assert single.energy == pytest.approx(double.energy, rel=1e-4)


# -- against motion -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["neo-hookean, coupled", "mooney-rivlin, uncoupled", "ogden -4.7, coupled"])
def test_relaxation_finds_the_same(name: str, device: str) -> None:
    model = pushed(MATERIALS[name], -1.0)
    expected = solve_equilibrium(System(model, device), EquilibriumOptions(tolerance=1e-10))
    found = relax_to_rest(System(model, device), RelaxationOptions(tolerance=1e-9))
    assert np.abs(found.u - expected.u).max() <= 1e-6 * np.abs(expected.u).max()
    assert all(step.min_J > 0.0 for step in found.history)


def test_relaxation_with_a_moved_boundary(device: str) -> None:
    model = stretched(BRAIN, 0.2, n=3)
    expected = solve_equilibrium(System(model, device), EquilibriumOptions(tolerance=1e-10))
    found = relax_to_rest(System(model, device), RelaxationOptions(tolerance=1e-9, time_step=0.01))
    assert np.abs(found.u - expected.u).max() <= 1e-6 * 0.2


def test_relaxation_recovers_from_a_step_that_inverts_elements(device: str) -> None:
    """Pressed by 30 %, in one step the elements of the top layer turn inside out: the displacement is then shared."""
    model = stretched(BRAIN, -0.3, n=5)
    expected = solve_equilibrium(System(model, device), EquilibriumOptions(tolerance=1e-10))
    found = relax_to_rest(System(model, device), RelaxationOptions(tolerance=1e-9))
    assert np.abs(found.u - expected.u).max() <= 1e-6 * 0.3


@pytest.mark.parametrize("swing", [False, True])
@pytest.mark.parametrize("time", [10.0, 1000.0])
def test_relaxation_waits_for_stress_that_relaxes(time: float, swing: bool) -> None:
    """Nothing but inertia is out of balance while a body creeps, and that is next to nothing."""
    model = replace(pushed(BRAIN, -1.0), mechanisms=(Viscoelasticity(moduli=(2.0,), times=(time,)),))
    expected = solve_equilibrium(System(model, "cpu"), EquilibriumOptions(tolerance=1e-10))
    found = relax_to_rest(System(model, "cpu"), RelaxationOptions(time_step=1.0, swing=swing))
    assert np.abs(found.u - expected.u).max() <= 1e-7 * np.abs(expected.u).max()


@pytest.mark.parametrize("solve", [solve_equilibrium, relax_to_rest])
@pytest.mark.parametrize("held", ["nothing", "one node", "one component"])
def test_a_body_that_is_not_held(held: str, solve: Callable[[System], object]) -> None:
    mesh = cube(2)
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    if held == "one node":
        constrained[0] = True
    elif held == "one component":
        constrained[:, 2] = mesh.points[:, 2] < 1e-12
    with pytest.raises(InputError, match="not held"):
        solve(System(model_of(mesh, BRAIN, constrained=constrained), "cpu"))


# -- several tissues ----------------------------------------------------------------------------------------------


def two_halves() -> TetMesh:
    mesh = distorted(cube(3), 0.03)
    centres = cube(3).points[cube(3).tetrahedra].mean(axis=1)
    return TetMesh(mesh.points, mesh.tetrahedra, np.where(centres[:, 0] < 0.5, 1, 2))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        pytest.param(BRAIN, Material(NeoHookean(3000.0), 0.3), id="two tissues of one law"),
        pytest.param(BRAIN, Material(LAWS["ogden 3 terms"], 0.4), id="two laws"),
        pytest.param(BRAIN, Material(LAWS["neo-hookean"], 0.45, "uncoupled"), id="two formulations"),
        pytest.param(Material(LAWS["ogden -20"]), Material(LAWS["ogden 3 terms"]), id="different numbers of terms"),
        pytest.param(Material(LAWS["mooney-rivlin"]), Material(LAWS["ogden -4.7"], 0.49, "uncoupled"), id="all"),
    ],
)
def test_tissues_add_up(one: Material, other: Material, device: str) -> None:
    """Forces and energy of a body are those of its parts, taken apart by hand."""
    mesh = two_halves()
    system = System(model_of(mesh, one, other), device)
    u = 0.05 * np.random.default_rng(2).uniform(-1.0, 1.0, mesh.points.shape)
    forces, energy = np.zeros(u.shape), 0.0
    for label, material in ((1, one), (2, other)):
        part, nodes, _ = mesh.without(mesh.tissue != label)
        piece = System(Model(part, {label: material}), device)
        forces[nodes] += forces_at(piece, u[nodes])
        energy += energy_at(piece, u[nodes])
    np.testing.assert_allclose(forces_at(system, u), forces, rtol=0.0, atol=1e-12 * np.abs(forces).max())
    assert energy_at(system, u) == pytest.approx(energy, rel=1e-12)


def test_a_border_between_equal_tissues_is_no_border(device: str) -> None:
    """Neo-Hookean here and its Ogden form there: as if one tissue filled the body."""
    mesh = two_halves()
    z = cube(3).points[:, 2]
    constrained = np.repeat((z < 1e-9)[:, None], 3, axis=1)
    load = [Gravity(direction=(0.3, 0.0, -1.0), density=20.0)]
    same = Material(Ogden((1000.0,), (2.0,)))
    options = EquilibriumOptions(tolerance=1e-11)
    found, expected = (
        solve_equilibrium(System(model_of(mesh, *pair, constrained=constrained, loads=load), device), options)
        for pair in ((BRAIN, same), (BRAIN, BRAIN))
    )
    assert np.abs(found.u - expected.u).max() <= 1e-9 * np.abs(expected.u).max()


def test_stresses_by_element(device: str) -> None:
    """The stresses of a body of two laws are those of each law at the element's deformation gradient."""
    mesh = two_halves()
    materials = Material(LAWS["mooney-rivlin"]), Material(LAWS["ogden -4.7"], 0.4, "uncoupled")
    system = System(model_of(mesh, *materials), device)
    u = 0.05 * np.random.default_rng(2).uniform(-1.0, 1.0, mesh.points.shape)
    system.u.assign(u)
    F = system.deformation_gradients()
    np.testing.assert_allclose(np.linalg.det(F).min(), system.energy()[1], rtol=1e-12)
    for label, material in enumerate(materials, start=1):
        members = mesh.tissue == label
        expected = stress_at(material, F[members], device)
        np.testing.assert_allclose(system.stresses()[members], expected, atol=1e-11 * np.abs(expected).max())


# -- failure ------------------------------------------------------------------------------------------------------


def test_impossible_load_is_told(device: str) -> None:
    """A uniaxial dead load that the weakest law cannot carry: where, at what fraction, why."""
    system = System(pushed(BRAIN, -500.0), device)
    with pytest.raises(SolveError) as failure:
        solve_equilibrium(system, EquilibriumOptions(min_load_step=0.02, pass_unstable=False))
    message = str(failure.value)
    found = re.match(
        r"no equilibrium found beyond ([\d.]+) % of the load, "
        r"after \d+ Newton iterations and load steps down to [\d.]+ %: (.+)",
        message,
    )
    assert found, message
    assert 0.0 <= float(found.group(1)) < 100.0
    assert re.search(r"element \d+ at \(-?[\d.]+, -?[\d.]+, -?[\d.]+\) mm, tissue 1, J = ", message), message


def test_a_crushed_body_says_so(device: str) -> None:
    """The clamped ends are driven through each other: no state with J > 0 exists."""
    system = System(stretched(BRAIN, -1.5, n=2), device)
    with pytest.raises(SolveError, match=r"no equilibrium found beyond \d[\d.]* % of the load"):
        solve_equilibrium(system, EquilibriumOptions(min_load_step=0.05))
    assert system.energy()[1] == system.energy()[1]  # the system can still be used


def test_a_start_without_end_is_told_and_warns_of_nothing(device: str, recwarn: pytest.WarningsRecorder) -> None:
    system = System(pushed(BRAIN, 0.01), device)
    far = np.zeros(system.model.mesh.points.shape)
    # stretched as far as numbers go whose square is not one
    far[:, 2] = 1e170 * system.model.mesh.points[:, 2]
    with pytest.raises(SolveError, match="the out-of-balance force is not finite"):
        EquilibriumSolver(system).solve(start=far)
    assert not recwarn.list


def dead_tractions(material: Material, tractions: tuple[float, float, float]) -> Model:
    """The unit cube under uniform dead tractions [Pa], held on its three planes of symmetry: uniform states."""
    n = 2
    mesh = cube(n)
    X = mesh.points
    ids = np.rint(X * n).astype(int)
    load = np.zeros(X.shape)
    # consistent forces of a uniform traction on the Kuhn mesh: a third of the area of each surface triangle
    for tetrahedron in mesh.tetrahedra:
        for skip in range(4):
            face = np.delete(tetrahedron, skip)
            for axis in range(3):
                if np.all(ids[face, axis] == n):
                    load[face, axis] += tractions[axis] / (2.0 * n * n) / 3.0
    constrained = ids == 0
    sets = {f"node {i}": np.arange(len(X)) == i for i in range(len(X))}
    loads = [NodalForce(nodes=f"node {i}", total=tuple(load[i])) for i in range(len(X)) if np.any(load[i])]
    return model_of(TetMesh(X, mesh.tetrahedra, node_sets=sets), material, constrained=constrained, loads=loads)


def failed_fraction(failure: pytest.ExceptionInfo[SolveError]) -> float:
    found = re.search(r"no equilibrium found beyond ([\d.]+) % of the load", str(failure.value))
    assert found
    return 0.01 * float(found.group(1))


def test_limit_load_is_told(device: str, verify: Row) -> None:
    """Considere's condition: where the dead load of a softening law has its maximum, the tangent turns indefinite.

    Ogden with alpha = -1 carries no more than `T = mu0 2 (l^-1/2 - l^-2)` at its maximum, near l = 2.5.
    """
    material = Material(Ogden((-2000.0,), (-1.0,)), 0.45, "uncoupled")

    def nominal(l: float) -> float:
        def P(side: float) -> np.ndarray:
            return stress_at(material, np.diag([side, side, l])[None], device)[0]

        side = brentq(lambda side: P(side)[0, 0], 0.3, 1.1, xtol=1e-13)
        return P(side)[2, 2]

    greatest = -minimize_scalar(lambda l: -nominal(l), bounds=(1.5, 4.0), method="bounded").fun
    below = System(dead_tractions(material, (0.0, 0.0, 0.97 * greatest)), device)
    found = solve_equilibrium(below, EquilibriumOptions(min_load_step=0.01, pass_unstable=False))
    l = 1.0 + found.u[-1, 2]
    assert nominal(l) == pytest.approx(0.97 * greatest, rel=1e-6)
    above = System(dead_tractions(material, (0.0, 0.0, 1.25 * greatest)), device)
    with pytest.raises(SolveError) as failure:
        solve_equilibrium(above, EquilibriumOptions(min_load_step=0.01, pass_unstable=False))
    # to the smallest load step, 1 %, at which the solver gives up
    error = abs(failed_fraction(failure) - 1.0 / 1.25)
    verify("limit load of a softening law, of the load", "Considere's condition", error, 0.01)
    # from a state under half of the limit: as much of what is added
    half = 0.5 / 1.25 * above.model.external_forces()
    start = EquilibriumSolver(above).solve(external=half).u
    with pytest.raises(SolveError) as failure:
        EquilibriumSolver(above, EquilibriumOptions(min_load_step=0.005, pass_unstable=False)).solve(start=start)
    assert abs(failed_fraction(failure) - (1.0 - 0.5) / (1.25 - 0.5)) < 0.01


RUBBER = Material(NeoHookean(1000.0), 0.499, "uncoupled")


def test_rivlin_cube_below_its_bifurcation(device: str) -> None:
    """C5: at T = 1.8 mu the cube itself is in stable equilibrium."""
    found = solve_equilibrium(System(dead_tractions(RUBBER, (1800.0, 1800.0, 1800.0)), device))
    # it swells as `K (J - 1) J = T l`, nothing else
    l = brentq(lambda l: RUBBER.volumetric_modulus * (l**3 - 1.0) * l**2 - 1800.0, 1.0, 1.1)
    np.testing.assert_allclose(1.0 + found.u[-1], l, rtol=1e-8)


def test_rivlin_cube_beyond_its_bifurcation_is_told(device: str) -> None:
    """C5: above T = 2 mu the cube is unstable; an imperfect one has no equilibrium nearby."""
    system = System(dead_tractions(RUBBER, (2200.0, 2200.0, 2178.0)), device)
    with pytest.raises(SolveError, match="the tangent stiffness is indefinite") as failure:
        solve_equilibrium(system, EquilibriumOptions(max_load_step=0.05, min_load_step=0.01, pass_unstable=False))
    # the bifurcation is at 2.0 / 2.2 = 91 % of this load; the imperfection brings the end of the path forward
    assert 0.8 <= failed_fraction(failure) <= 0.93


def test_an_unstable_state_is_passed_and_said(device: str) -> None:
    """Where it may, the solver goes on downhill to a stable state with less potential, and counts the way."""
    system = System(dead_tractions(RUBBER, (2200.0, 2200.0, 2178.0)), device)
    found = solve_equilibrium(system, EquilibriumOptions(pass_unstable=True))
    assert found.unstable_iterations > 0
    external = system.model.external_forces()
    free = ~system.model.constrained
    assert np.linalg.norm((found.internal - external)[free]) <= 1e-7 * np.linalg.norm(external)
    assert all(step.min_J > 0.0 for step in found.history)
    assert found.energy - np.vdot(external, found.u) < 0.0


@pytest.mark.parametrize(
    ("acting", "poisson", "expected"),
    [
        (Swelling(amount=26.0), 0.3, 2.0),
        (ResidualStress(direction=(0.0, 0.0, 1.0), tension=300.0), 0.4999, None),
    ],
    ids=["grown to 27 times its volume", "contracted, nearly incompressible"],
)
def test_a_state_without_any_force_is_found(
    acting: Mechanism, poisson: float, expected: float | None, device: str
) -> None:
    """Nothing but rounding is left of the forces, which a residual relative to them cannot tell from imbalance."""
    mesh = distorted(cube(2), 0.03)
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    for corner, axes in (((0, 0, 0), (0, 1, 2)), ((1, 0, 0), (1, 2)), ((0, 1, 0), (2,))):
        constrained[np.argmin(np.linalg.norm(mesh.points - corner, axis=1)), list(axes)] = True
    material = Material(NeoHookean(1000.0), poisson, "uncoupled")
    system = System(model_of(mesh, material, constrained=constrained, mechanisms=[acting]), device)
    u = solve_equilibrium(system).u
    stretches = np.linalg.svd(system.deformation_gradients(), compute_uv=False)
    assert np.ptp(stretches, axis=0).max() < 1e-7
    if expected is not None:
        np.testing.assert_allclose(stretches, 1.0 + expected, rtol=1e-7)
    assert np.isfinite(u).all()
