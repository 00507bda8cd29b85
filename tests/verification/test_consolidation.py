"""Consolidation: a skeleton that carries load as its fluid flows away, against closed forms and a fine grid.

Terzaghi's column and Mandel's slab are of small strain: the loads are small. Values of the series at dimensionless
times `c t / H^2` are those of its 200 first terms.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from bodies import model_of
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from shapes import box
from verification_rows import Row

from warpbrain.mesh import TetMesh, boundary_faces, node_areas
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.load import Load
from warpbrain.physics.mechanisms.drainage import Drainage, DrainageTerm
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.model import Damping, Material, Model, Motion
from warpbrain.simulation.quasi_static import follow_slowly
from warpbrain.simulation.system import System

MU, POISSON, PERMEABILITY = 1000.0, 0.2, 1e-9
LAM = 2.0 * MU * POISSON / (1.0 - 2.0 * POISSON)
#: Of confined compression [Pa], and the coefficient of consolidation [m2/s].
MODULUS = LAM + 2.0 * MU
SPREADING = PERMEABILITY * MODULUS

#: Settlement and pressure at the base at a dimensionless time, drained at the top alone.
TERZAGHI = {
    0.01: (0.112837917, 1.0),
    0.05: (0.252313252, 0.996869195),
    0.1: (0.3568234, 0.949305363),
    0.2: (0.50408782, 0.772311607),
    0.5: (0.763950331, 0.37077743),
    1.0: (0.931259678, 0.107977044),
}
#: Pressure at the middle and half way out, `nu` 0.2, nothing compressible: it rises before it falls.
MANDEL = {
    0.001: (1.01352282, 1.01352282),
    0.01: (1.04376115, 1.04334875),
    0.05: (1.09888329, 0.982236192),
    0.1: (1.09541374, 0.860902585),
    0.5: (0.592785383, 0.428126704),
}


@dataclass(frozen=True, kw_only=True)
class Cover(Load):
    """A dead force for each area [Pa], downwards, on the last face along an axis."""

    value: float
    normal: int = 2
    direction: int = 2

    def nodal_forces(self, mesh: TetMesh) -> np.ndarray:
        along = mesh.points[:, self.normal]
        faces = boundary_faces(mesh.tetrahedra)
        end = faces[(along > along.max() - 1e-9)[faces].all(axis=1)]
        return np.outer(node_areas(mesh.points, end), -self.value * np.eye(3)[self.direction])


def column(cells: int, load: float, **options) -> Model:
    """A column of the height 1, as many cells, in a tube with a closed bottom; drained at the top."""
    mesh = box((1, 1, cells), (1.0 / cells, 1.0 / cells, 1.0))
    z = mesh.points[:, 2]
    mesh = replace(mesh, node_sets={"top": z > 1.0 - 1e-9})
    constrained = np.ones(mesh.points.shape, dtype=bool)
    constrained[:, 2] = z < 1e-9
    fluid = Drainage(permeability=PERMEABILITY, drained="top")
    loads = (Cover(value=load),)
    return model_of(
        mesh, Material(NeoHookean(MU), POISSON), constrained=constrained, loads=loads, mechanisms=(fluid,), **options
    )


def fluid_of(system: System) -> DrainageTerm:
    [term] = [term for term in system.terms if isinstance(term, DrainageTerm)]
    return term


def consolidated(cells: int, steps: int, end: float, device: str = "cpu") -> tuple[float, float]:
    """Settlement and pressure at the base at a dimensionless time, after as many steps that grow from next to none."""
    load = 0.01
    system = System(column(cells, load), device)
    times = end / SPREADING * (np.arange(1, steps + 1) / steps) ** 2
    for moment in follow_slowly(system, times.tolist()):
        state = moment.state
    base = system.model.mesh.points[:, 2] < 1e-9
    return -state.u[:, 2].min() * MODULUS / load, fluid_of(system).pressures()[base].mean() / load


def without_steps(value: Callable[[int], np.ndarray], steps: int) -> np.ndarray:
    """Richardson's extrapolation of a method of first order in time, from as many steps and from twice as many."""
    return 2.0 * value(2 * steps) - value(steps)


@pytest.mark.slow(2)
@pytest.mark.parametrize(
    "time", [pytest.param(time, marks=[] if time in (0.01, 0.2, 1.0) else [pytest.mark.slow(1)]) for time in TERZAGHI]
)
def test_a_column_settles_as_terzaghi_says(time: float, device: str, verify: Row) -> None:
    coarse, fine = (
        without_steps(lambda steps, cells=cells: np.array(consolidated(cells, steps, time, device)), 12)
        for cells in (8, 16)
    )
    error = np.abs((4.0 * fine - coarse) / 3.0 - TERZAGHI[time]).max()
    claim = "settlement and base pressure of Terzaghi's column at six times, of the whole"
    verify(claim, "series, given to nine digits; extrapolated in mesh and time", error, 1.5e-3)


@pytest.mark.slow(4)
def test_of_first_order_in_time_and_of_second_in_space(verify: Row) -> None:
    exact, found = np.array(TERZAGHI[0.2]), {}
    for cells in (4, 8):
        found[cells] = {steps: np.array(consolidated(cells, steps, 0.2)) for steps in (8, 16, 32, 64)}
    # what is left of backward Euler is taken away by Richardson's extrapolation
    limit = {cells: 2.0 * by_steps[64] - by_steps[32] for cells, by_steps in found.items()}
    in_time = [np.abs(found[8][steps] - limit[8]).max() for steps in (8, 16)]
    claim, by = "Terzaghi's column, 8 to 32 steps: order 1 in time, off by", "series; Richardson's extrapolation"
    # it comes down to 1: the next order in time is 0.07 at 8 steps
    verify(claim, by, abs(np.log2(in_time[0] / in_time[1]) - 1.0), 0.1, "orders")
    in_space = [np.abs(limit[cells] - exact).max() for cells in (4, 8)]
    claim = "Terzaghi's column, 4 and 8 cells: order 2 in space, off by"
    verify(claim, by, abs(np.log2(in_space[0] / in_space[1]) - 2.0), 0.15, "orders")


def slab(cells: int, per: int) -> tuple[System, np.ndarray, np.ndarray]:
    """A quarter of Mandel's slab between plates that move as they do under a constant force; times, dimensionless."""
    mesh = box((cells, 1, cells), (1.0, 1.0 / cells, 1.0))
    x, _, z = mesh.points.T
    mesh = replace(mesh, node_sets={"outside": x > 1.0 - 1e-9})
    top = z > 1.0 - 1e-9
    constrained = np.stack([x < 1e-9, np.ones(len(x), dtype=bool), top | (z < 1e-9)], axis=1)
    ends = np.array([0.0, *MANDEL])
    times = np.concatenate([np.linspace(a, b, per + 1)[1:] for a, b in pairwise(ends)])
    eta = (1.0 - POISSON) / (0.5 - POISSON)
    roots = np.array(
        [brentq(lambda a: np.tan(a) - eta * a, k * np.pi + 1e-9, (k + 0.5) * np.pi - 1e-9) for k in range(200)]
    )
    sine, cosine = np.sin(roots), np.cos(roots)
    series = np.exp(-np.outer(times, roots**2)) @ (sine * cosine / (roots - sine * cosine))
    # Cheng and Detournay 1988, with an undrained Poisson ratio of 1/2; a mean pressure of 0.01 Pa on the plates
    moved = 0.01 / (2.0 * MU) * (series - (1.0 - POISSON))
    values = np.stack([0.0 * moved, 0.0 * moved, moved], axis=1)
    prescribed = np.where(top[:, None], values[-1], 0.0)
    model = model_of(
        mesh,
        Material(NeoHookean(MU), POISSON),
        constrained=constrained,
        prescribed=prescribed,
        motions=(Motion(top, times / SPREADING, values),),
        mechanisms=(Drainage(permeability=PERMEABILITY, drained="outside"),),
    )
    return System(model, "cpu"), times, top


def squeezed(cells: int, per: int) -> np.ndarray:
    """Pressure at the middle and half way out, and force on the plates, at the times of `MANDEL`, all of 1 (k, 3)."""
    system, times, top = slab(cells, per)
    x = system.model.mesh.points[:, 0]
    found = []
    for number, moment in enumerate(follow_slowly(system, (times / SPREADING).tolist()), 1):
        if number % per == 0:
            # pressure without flow under a mean pressure of 0.01 Pa is a half of that
            pressure = fluid_of(system).pressures() / 0.005
            at_middle, at_half = pressure[x < 1e-9], pressure[np.abs(x - 0.5) < 1e-9]
            # a slab is as uniform across its thickness as elements are
            assert np.ptp(at_middle) < 0.03 * at_middle.mean()
            # the plates were moved, and no force was prescribed
            force = -moment.state.internal[top, 2].sum() / (0.01 / cells)
            found.append([at_middle.mean(), at_half.mean(), force])
    return np.array(found)


@pytest.mark.slow
def test_pressure_rises_between_mandels_plates_before_it_falls(verify: Row) -> None:
    coarse, fine = (without_steps(lambda steps, cells=cells: squeezed(cells, steps), 6) for cells in (6, 12))
    expected = np.array([[*pressures, 1.0] for pressures in MANDEL.values()])
    error = np.abs((4.0 * fine - coarse) / 3.0 / expected - 1.0)
    assert fine[:, 0].max() > 1.09
    by = "series; extrapolated in mesh and time"
    verify("pressures in Mandel's slab, at five times", by, error[:, :2].max(), 2e-3)
    verify("force on the plates of Mandel's slab, at five times", by, error[:, 2].max(), 5e-4)


def one_dimension(load: float, time: float) -> float:
    """Settlement of a column of height 1 at large strain, on a fine grid: `dl/dt = d/dZ (k/l dP/dl dl/dZ)`."""

    def stress(stretch):
        return MU * (stretch - 1.0 / stretch) + LAM * np.log(stretch) / stretch

    def slope(stretch):
        return MU * (1.0 + stretch**-2) + LAM * (1.0 - np.log(stretch)) / stretch**2

    n = 400
    at_top = brentq(lambda stretch: stress(stretch) + load, 0.2, 1.0)

    def rate(_, stretch):
        # no flow through the bottom; half a cell to the top, where the skeleton carries the load
        between = 0.5 * (stretch[1:] + stretch[:-1])
        flow = PERMEABILITY / between * slope(between) * np.diff(stretch) * n
        end = PERMEABILITY / at_top * slope(at_top) * (at_top - stretch[-1]) * 2.0 * n
        return n * np.diff(np.concatenate([[0.0], flow, [end]]))

    solved = solve_ivp(rate, (0.0, time), np.ones(n), method="LSODA", lband=1, uband=1, rtol=1e-8, atol=1e-10)
    return float(1.0 - solved.y[:, -1].mean())


def test_at_large_strain_flow_is_that_of_the_deformed_body(verify: Row) -> None:
    load, end = 1500.0, 0.3 / SPREADING
    expected = one_dimension(load, end)
    assert expected > 0.3

    def settled(steps: int) -> np.ndarray:
        times = end * np.linspace(0.0, 1.0, steps + 1)[1:] ** 2
        for moment in follow_slowly(System(column(12, load), "cpu"), times.tolist()):
            state = moment.state
        return -state.u[:, 2].min()

    error = abs(without_steps(settled, 12) / expected - 1.0)
    claim = "settlement of a column that loses a third of its height"
    verify(claim, "one dimension, 400 cells, SciPy; extrapolated in time", error, 1e-3)


def test_what_is_drained_is_the_skeleton_as_febio_has_it(verify: Row) -> None:
    """FEBio's `bp04`: confined, E = 1, no Poisson ratio, to 90 % of its height: -0.105555556."""
    mesh = box((1, 1, 10), (0.1, 0.1, 1.0))
    top = mesh.points[:, 2] > 1.0 - 1e-9
    mesh = replace(mesh, node_sets={"top": top})
    constrained = np.ones(mesh.points.shape, dtype=bool)
    constrained[:, 2] = top | (mesh.points[:, 2] < 1e-9)
    prescribed = np.where(top[:, None], [0.0, 0.0, -0.1], 0.0)
    motion = Motion(top, np.array([0.0, 100.0]), np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -0.1]]))
    model = model_of(
        mesh,
        Material(NeoHookean(0.5), 0.0),
        constrained=constrained,
        prescribed=prescribed,
        motions=(motion,),
        mechanisms=(Drainage(permeability=1e-3, drained="top"),),
    )
    system = System(model, "cpu")
    stresses = []
    for moment in follow_slowly(system, [*np.linspace(10.0, 100.0, 10), *np.geomspace(120.0, 1e4, 20)]):
        stresses.append(moment.state.internal[top, 2].sum() / 0.01)
    assert stresses[9] < -0.12
    error = abs(stresses[-1] / -0.105555556 - 1.0)
    verify("stress in the end of a confined column with fluid (FEBio bp04)", "FEBio, nine digits", error, 1e-6)


def bent_without_flow(stabilised: float) -> tuple[float, float]:
    """Cook's membrane (mm, N) of 8 x 8 cells under a hundredth of its load, for a moment too short for any flow.

    Returns the displacement of the tip for the whole load, and how far pressures are from a smooth function, relative
    to their spread, away from the ends.
    """
    mesh = box((8, 8, 1), (48.0, 44.0, 1.0))
    x, y, z = mesh.points.T
    low, width = 44.0 / 48.0 * x, 44.0 - 28.0 / 48.0 * x
    points = np.stack([x, low + y / 44.0 * width, z], axis=1)
    mesh = replace(mesh, points=points, node_sets={"left": x < 1e-9})
    constrained = np.zeros(points.shape, dtype=bool)
    constrained[:, 2] = True
    constrained[x < 1e-9] = True
    fluid = Drainage(permeability=1e-12, drained="left")
    loads = (Cover(value=-0.01 / 16.0, normal=0, direction=1),)
    model = model_of(
        mesh, Material(NeoHookean(0.4225), POISSON), constrained=constrained, loads=loads, mechanisms=(fluid,)
    )
    system = System(model, "cpu")
    term = fluid_of(system)
    term.softness *= stabilised
    [moment] = follow_slowly(system, [1.0])
    inner = (x > 8.0) & (x < 40.0) & (y > 7.0) & (y < 37.0)
    powers = [(x / 48.0) ** i * (y / 44.0) ** k for i in range(5) for k in range(5 - i)]
    smooth, pressure = np.stack(powers, axis=1)[inner], term.pressures()[inner]
    rest = pressure - smooth @ np.linalg.lstsq(smooth, pressure, rcond=None)[0]
    return 100.0 * moment.state.u[:, 1].max(), float(rest.std() / pressure.std())


def test_without_flow_tissue_keeps_its_volume_and_pressures_do_not_alternate() -> None:
    tip, roughness = bent_without_flow(1.0)
    # small strain, and a coarse mesh: linear tetrahedra at a Poisson ratio of 0.499 reach less than a half of it
    assert 10.0 < tip < 14.0
    # a fifth of their spread: with a tenth of the stabilisation they alternate, by more than a half
    assert roughness < 0.2
    assert bent_without_flow(0.1)[1] > 0.5


@pytest.mark.slow(3)
def test_damped_motion_consolidates_too():
    """Slow motion is a series of equilibria; what is damped is the skeleton alone."""
    load = 0.01
    end = 0.1 / SPREADING
    model = column(8, load, density=1.0, damping=Damping(0.001, 0.0))
    for moment in follow_slowly(System(model, "cpu"), (end / 40 * np.arange(1, 41)).tolist()):
        slow = -moment.state.u[:, 2].min() * MODULUS / load
    for newton in (1, 2):
        system = System(model, "cpu")
        simulator = Simulator(system, time_step=end / 40, tolerance=1e-9, newton=newton)
        for _ in range(40):
            simulator.step()
        assert -system.u.numpy()[:, 2].min() * MODULUS / load == pytest.approx(slow, rel=1e-4)
