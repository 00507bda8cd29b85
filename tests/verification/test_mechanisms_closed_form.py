"""Mechanisms in bodies with closed-form or one-dimensional solutions.

Numbers of an incompressible tissue are extrapolated linearly in `1 - 2 nu` from two Poisson ratios close to 1/2, in
homogeneous states, where nothing locks.
"""

import json
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from bodies import model_of
from scipy.integrate import quad
from shapes import cube, octant, quarter, swept
from verification_rows import Row

from warpbrain.errors import SolveError
from warpbrain.mesh import TetMesh, boundary_faces, node_areas
from warpbrain.physics.laws import Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.equilibrium import Equilibrium, EquilibriumOptions, EquilibriumSolver, solve_equilibrium
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

NUMBERS = json.loads((Path(__file__).parent / "data" / "structures.json").read_text())
LAWS: dict[str, Law] = {
    "nh": NeoHookean(1000.0),
    "mr": MooneyRivlin(300.0, 200.0),
    "ogden": Ogden((-2000.0 / 4.7,), (-4.7,)),
}
EXACT = EquilibriumOptions(tolerance=1e-11)


def incompressible(value: Callable[[float], float]) -> float:
    """Linear in `1 - 2 nu`, from 2e-4 and 1e-4."""
    return 2.0 * value(0.49995) - value(0.4999)


# -- C3: a thick sphere and a thick cylinder under live pressure ----------------------------------------------------


def wall(shape: str, n: int) -> TetMesh:
    """An octant of a sphere, a quarter of a slice of a cylinder; radii 1 and 2."""

    def on_cylinder(xy: np.ndarray, s: np.ndarray) -> np.ndarray:
        radius, angle = 2.0 ** xy[:, 1], 0.5 * np.pi * xy[:, 0]
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.1 * s], axis=1)

    mesh = octant(n, n, lambda s: 2.0**s) if shape == "sphere" else swept(quarter(n), 1, on_cylinder)
    points = np.where(np.abs(mesh.points) < 1e-12, 0.0, mesh.points)
    radius = np.linalg.norm(points[:, : 3 if shape == "sphere" else 2], axis=1)
    sets = {"inner": radius < 1.0 + 1e-9, "outer": radius > 2.0 - 1e-9}
    return TetMesh(points, mesh.tetrahedra, node_sets=sets)


def inflated(shape: str, n: int, law: Law, elements: str, device: str) -> np.ndarray:
    """Mean radial displacement of the inner and the outer surface."""
    mesh = wall(shape, n)
    constrained = mesh.points == 0.0
    radial = mesh.points.copy()
    if shape == "cylinder":
        constrained[:, 2] = True
        radial[:, 2] = 0.0
    radial /= np.linalg.norm(radial, axis=1)[:, None]
    model = model_of(
        mesh,
        Material(law, 0.45, "uncoupled"),
        constrained=constrained,
        mechanisms=[Pressure(nodes="inner", value=100.0)],
        elements=elements,
    )
    u = solve_equilibrium(System(model, device), EquilibriumOptions(tolerance=1e-8)).u
    return np.array([np.mean(np.sum(u * radial, axis=1)[mesh.node_sets[side]]) for side in ("inner", "outer")])


#: Largest relative error of a displacement allowed, extrapolated in h^2.
ALLOWED = {
    ("sphere", "tet4"): 0.01,
    ("sphere", "tet4-averaged"): 0.008,
    ("cylinder", "tet4"): 0.0015,
    ("cylinder", "tet4-averaged"): 0.0015,
}


@pytest.mark.parametrize("elements", ["tet4", "tet4-averaged"])
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("shape", ["sphere", "cylinder"])
def test_live_pressure(shape: str, name: str, elements: str, device: str, verify: Row) -> None:
    said = NUMBERS[f"C3 thick {shape} compressible {name} nu=0.45 A=1 B=2 inner pressure 100 Pa"]
    expected = np.array([said["u_inner"], said["u_outer"]])
    sizes = (3, 6, 12) if shape == "sphere" else (4, 8, 16)
    found = [inflated(shape, n, LAWS[name], elements, device) for n in sizes]
    errors = [np.abs(u / expected - 1.0).max() for u in found]
    extrapolated = np.abs((4.0 * found[-1] - found[-2]) / 3.0 / expected - 1.0).max()
    claim = f"displacements of a thick {shape} under `pressure`, {elements}, nu 0.45, three laws"
    verify(claim, "one dimension, converged; extrapolated in the mesh", extrapolated, ALLOWED[shape, elements])
    # near the second order
    assert errors[-2] / errors[-1] > 2.5


# -- C5: Rivlin's cube ----------------------------------------------------------------------------------------------


def pulled(ratio: float, poisson: float, start: np.ndarray, **options: object) -> tuple[np.ndarray, Equilibrium]:
    """Stretches of a unit cube, free to stretch along its edges, under a dead traction `ratio mu` on all faces."""
    mesh = cube(1)
    faces = boundary_faces(mesh.tetrahedra)
    external = np.zeros(mesh.points.shape)
    for k in range(3):
        on = mesh.points[faces][:, :, k].min(axis=1) == 1.0
        external[:, k] = 1000.0 * ratio * node_areas(mesh.points, faces[on])
    material = Material(NeoHookean(1000.0), poisson, "uncoupled")
    system = System(model_of(mesh, material, constrained=mesh.points == 0.0), "cpu")
    solver = EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-10, **options))
    found = solver.solve(external, mesh.points * start)
    F = system.deformation_gradients()
    np.testing.assert_allclose(F, np.broadcast_to(np.diag(np.diag(F[0])), F.shape), atol=1e-6)
    return np.diag(F[0]), found


def test_rivlins_cube_leaves_its_symmetry() -> None:
    """Above a traction of 2 mu the tangent is indefinite, which Newton's method says, and a flatter start ends flat."""
    rest = np.zeros(3)
    for ratio, unstable in ((1.5, False), (2.2, True)):
        stretches, found = pulled(ratio, 0.49, rest)
        np.testing.assert_allclose(stretches, stretches.mean(), rtol=1e-6)
        # at perfect symmetry no search direction leads out of it
        assert found.unstable_iterations == 0
        stretches, found = pulled(ratio, 0.49, np.array([-0.02, 0.0, 0.0]))
        assert (found.unstable_iterations > 0) == unstable
        assert (np.ptp(stretches) > 1.0) == unstable
    with pytest.raises(SolveError, match="tangent stiffness is indefinite"):
        pulled(2.2, 0.49, np.array([0.3, -0.1, -0.1]), pass_unstable=False)


def test_branches_of_rivlins_cube(verify: Row) -> None:
    """`l + l^-2 = T/mu`: the plate, followed from nu = 0.49 to nearly 1/2, and the rod."""

    def plate(poisson: float) -> float:
        start = np.array([-0.3, 0.1, 0.1])
        for nu in (0.49, 0.499, poisson):
            stretches, _ = pulled(2.2, nu, start)
            start = stretches - 1.0
        np.testing.assert_allclose(stretches[1], stretches[2], rtol=1e-6)
        return float(stretches[1])

    def rod(poisson: float) -> float:
        stretches, _ = pulled(2.2, poisson, np.array([0.335, -0.134, -0.134]))
        np.testing.assert_allclose(stretches[1], stretches[2], rtol=1e-6)
        return float(stretches[1])

    by = "closed form, incompressible; extrapolated in nu"
    verify("stretch of Rivlin's cube as a plate", by, abs(incompressible(plate) / 1.93212724 - 1.0), 1e-6)
    verify("stretch of Rivlin's cube as a rod", by, abs(incompressible(rod) / 0.86571723 - 1.0), 1e-6)


# -- F1, F2: relaxation ---------------------------------------------------------------------------------------------

#: `g_inf = g_1 = 0.5`: what relaxes is as stiff as what is left. [s]
RELAXING = Viscoelasticity(moduli=(1.0,), times=(2.0,))


class Sheared:
    """A cube in simple shear, every node prescribed, with a memory."""

    def __init__(self) -> None:
        mesh = cube(1)
        held = np.ones(mesh.points.shape, dtype=bool)
        material = Material(NeoHookean(1000.0), 0.45, "uncoupled")
        self.model = model_of(mesh, material, constrained=held, mechanisms=[RELAXING])
        self.solver = EquilibriumSolver(System(self.model, "cpu"), EXACT)
        self.u = np.zeros(mesh.points.shape)
        for term in self.solver.system.terms:
            term.forget()

    def to(self, shear: float, h: float) -> float:
        """Nominal shear stress [Pa] after a step of time: forces on the top over its area."""
        z = self.model.mesh.points[:, 2]
        u = np.stack([shear * z, 0.0 * z, 0.0 * z], axis=1)
        found = self.solver.step(self.u, h, prescribed=u)
        self.u = found.u
        return float(found.internal[z == 1.0, 0].sum())


def test_relaxation_after_a_step(verify: Row) -> None:
    """F1, at finite shear: in simple shear the stress of the isochoric law is linear. In as many steps as one likes."""
    for steps in (1, 7):
        body = Sheared()
        first = body.to(0.5, 0.0)
        assert first == pytest.approx(1000.0 * 0.5 * 2.0, rel=1e-10)
        now = 0.0
        for time, expected in ((1.0, 0.80326533), (2.0, 0.683939721), (10.0, 0.503368973)):
            for _ in range(steps):
                stress = body.to(0.5, (time - now) / steps)
            now = time
            error = abs(stress / first - expected)
            verify("stress of a step of shear as it relaxes", "closed form, nine digits", error, 1e-8)


def test_relaxation_after_a_ramp(verify: Row) -> None:
    """F2: 1 s up to a small shear, then held. The error falls with the square of the step: 2.6e-6 with 40 steps."""
    expected = {1.0: 0.89346934, 2.0: 0.738651219, 5.0: 0.553250285}
    errors = []
    for steps in (10, 20, 40):
        body, shear = Sheared(), 1e-4
        for k in range(1, steps + 1):
            found = {1.0: body.to(shear * k / steps, 1.0 / steps)}
        found |= {2.0: body.to(shear, 1.0), 5.0: body.to(shear, 3.0)}
        errors.append(max(abs(found[t] / (2000.0 * shear) - expected[t]) for t in expected))
    verify("stress of a ramp of shear as it relaxes, 40 steps", "closed form", errors[-1], 5e-6)
    for coarse, fine in pairwise(errors):
        order = float(np.log2(coarse / fine))
        verify("stress of a ramp of shear: order 2 in time, off by", "closed form", abs(order - 2.0), 0.05, "orders")


def test_hysteresis_of_a_cycle(verify: Row) -> None:
    """Shear of 0.4 sin(t), at all times beside the convolution integral by quadrature; and the work that is lost.

    With `S_12 = -mu I1/3 (C^-1)_12` and `S_22` of the isochoric law in simple shear, `P_12 = S_12 + g S_22`.
    """

    def stresses(g: float) -> np.ndarray:
        third = (3.0 + g * g) / 3.0
        return 1000.0 * np.array([third * g, 1.0 - third])

    def slopes(g: float) -> np.ndarray:
        return (stresses(g + 1e-5) - stresses(g - 1e-5)) / 2e-5

    def nominal(t: float) -> float:
        faded = [
            quad(lambda s, i=i: np.exp(-(t - s) / 2.0) * slopes(shear(s))[i] * 0.4 * np.cos(s), 0.0, t, epsrel=1e-9)[0]
            for i in range(2)
        ]
        S = stresses(shear(t)) + faded
        return float(S[0] + shear(t) * S[1])

    def shear(t: float) -> float:
        return 0.4 * np.sin(t)

    def followed(steps: int) -> np.ndarray:
        body = Sheared()
        times = np.linspace(0.0, 2.0 * np.pi, steps + 1)
        return np.array([0.0] + [body.to(shear(t), times[1]) for t in times[1:]])

    times = np.linspace(0.0, 2.0 * np.pi, 25)
    expected = np.array([nominal(t) for t in times])
    errors = [np.abs(followed(n)[:: n // 24] - expected).max() / np.abs(expected).max() for n in (48, 96)]
    by = "convolution integral by quadrature"
    verify("stress of a cycle of 40 % shear, 96 steps", by, errors[1], 2e-4)
    verify("stress of a cycle: order 2 in time, off by", by, abs(np.log2(errors[0] / errors[1]) - 2.0), 0.1, "orders")
    fine = np.linspace(0.0, 2.0 * np.pi, 97)
    lost = np.trapezoid(followed(96), shear(fine))
    error = abs(lost / np.trapezoid([nominal(t) for t in fine], shear(fine)) - 1.0)
    verify("work that a cycle of 40 % shear loses, 96 steps", by, error, 1e-3)
    assert lost > 0.0


# -- G1, G2: growth -------------------------------------------------------------------------------------------------


def grown(change: float, constrained: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stretches and Cauchy stresses along the axes of a cube that has grown by a relative change of volume."""
    material = Material(NeoHookean(1000.0), 0.45, "uncoupled")
    model = model_of(cube(1), material, constrained=constrained, mechanisms=[Swelling(amount=change)])
    system = System(model, "cpu")
    solve_equilibrium(system, EXACT)
    F, P = system.deformation_gradients(), system.stresses()
    np.testing.assert_allclose(F, np.broadcast_to(F[0], F.shape), atol=1e-10)
    return np.diag(F[0]), np.diag(P[0] @ F[0].T) / np.linalg.det(F[0])


@pytest.mark.parametrize(
    ("change", "free", "clamped", "walled"),
    [
        (0.01, 1.00332228, 95.7095712, 1.00877749),
        (0.05, 1.01639636, 460.31746, 1.04367944),
        (0.10, 1.03228012, 878.787879, 1.08683748),
    ],
)
def test_growth(change: float, free: float, clamped: float, walled: float, verify: Row) -> None:
    """Free: no stress. Clamped: a pressure. Between lateral walls: it rises."""
    x = cube(1).points
    stretches, stress = grown(change, x == 0.0)
    by = "closed form, nine digits"
    verify("`swelling` of a free cube: stretch", by, np.abs(stretches / free - 1.0).max(), 1e-8)
    np.testing.assert_allclose(stress, 0.0, atol=1e-6)
    _, stress = grown(change, np.ones(x.shape, dtype=bool))
    verify("`swelling` of a clamped cube: pressure", by, np.abs(-stress / clamped - 1.0).max(), 1e-8)
    walls = np.ones(x.shape, dtype=bool)
    walls[:, 2] = x[:, 2] == 0.0
    stretches, stress = grown(change, walls)
    verify("`swelling` of a cube between walls: stretch", by, abs(stretches[2] / walled - 1.0), 1e-8)
    assert abs(stress[2]) < 1e-6 and stress[0] < 0.0


# -- I1: fibres -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("stretch", "expected"), [(1.05, 256.400329), (1.1, 561.541402), (1.2, 1895.60734)])
def test_tension_along_fibres(stretch: float, expected: float, verify: Row) -> None:
    """Nominal stress, extrapolated to an incompressible cube."""
    x = cube(1).points
    constrained = x == 0.0
    constrained[x[:, 0] == 1.0, 0] = True
    prescribed = np.where(constrained & (x == 1.0), stretch - 1.0, 0.0)
    fibres = Fibres(direction=(1.0, 0.0, 0.0), stiffness=500.0, exponent=5.0)

    def tension(poisson: float) -> float:
        material = Material(NeoHookean(1000.0), poisson, "uncoupled")
        model = model_of(cube(1), material, constrained=constrained, prescribed=prescribed, mechanisms=[fibres])
        return float(solve_equilibrium(System(model, "cpu"), EXACT).internal[x[:, 0] == 1.0, 0].sum())

    by = "closed form, incompressible, nine digits; extrapolated in nu"
    verify("stress of a cube stretched along its `fibres`", by, abs(incompressible(tension) / expected - 1.0), 1e-8)
