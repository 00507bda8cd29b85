"""Models and the choice of a device: what is refused, and with which words."""

import math

import numpy as np
import pytest
from bodies import model_of
from shapes import box, cube, distorted

from warpbrain.errors import InputError
from warpbrain.kernels.module import DOUBLE, SINGLE, find_device, find_precision
from warpbrain.mesh import QuadraticMesh, TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.load import NodalForce
from warpbrain.physics.mechanisms.cavity import Cavity
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumOptions
from warpbrain.simulation.model import Damping, Material, Model
from warpbrain.simulation.system import System

MESH = cube(1)
SHAPE = MESH.points.shape
SOFT = Material(NeoHookean(100.0))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"constrained": np.zeros((3, 3), dtype=bool)}, r"constrained: expected a boolean array of shape \(8, 3\)"),
        ({"constrained": np.zeros(SHAPE)}, "constrained: expected a boolean array"),
        ({"prescribed": np.zeros(3)}, r"prescribed: expected an array of shape \(8, 3\), found \(3,\)"),
        ({"prescribed": np.full(SHAPE, np.nan)}, "prescribed: the displacement of node 0 is not finite"),
        ({"prescribed": np.ones(SHAPE)}, "a component that is not constrained has a displacement"),
        ({"density": 0.0}, "density = 0 kg/m3: expected a positive number"),
        ({"density": math.nan}, "density = nan kg/m3"),
    ],
)
def test_model_refuses(options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        model_of(MESH, SOFT, **options)


def test_every_tissue_needs_a_material() -> None:
    mesh = TetMesh(MESH.points, MESH.tetrahedra, [1, 1, 2, 2, 7, 7])
    with pytest.raises(InputError, match="materials: no material for tissue 2, 7 of the mesh"):
        Model(mesh, {1: SOFT})
    Model(mesh, {1: SOFT, 2: SOFT, 7: SOFT, 9: SOFT})


@pytest.mark.parametrize("options", [{"stiffness": -1.0}, {"mass": -1.0}, {"stiffness": math.nan}])
def test_damping_refuses(options: dict) -> None:
    with pytest.raises(InputError, match=r"damping: .* expected a number >= 0"):
        Damping(**options)


def test_mass_is_shared_by_the_nodes() -> None:
    model = model_of(box((2, 3, 1), (0.1, 0.2, 0.05)), SOFT, density=1000.0)
    assert model.mass == pytest.approx(1.0)
    assert model.node_masses.sum() == pytest.approx(1.0)
    assert np.all(model.node_masses > 0.0)


def test_loads_are_summed_with_their_ramps() -> None:
    mesh = TetMesh(MESH.points, MESH.tetrahedra, node_sets={"all": np.ones(8, dtype=bool)})
    loads = [
        NodalForce(nodes="all", total=(8.0, 0.0, 0.0), ramp=[(0.0, 0.0), (1.0, 1.0)]),
        NodalForce(nodes="all", total=(0.0, 8.0, 0.0)),
    ]
    model = model_of(mesh, SOFT, loads=loads)
    np.testing.assert_allclose(model.external_forces(0.25), np.tile([0.25, 1.0, 0.0], (8, 1)))
    np.testing.assert_allclose(model.external_forces(), np.tile([1.0, 1.0, 0.0], (8, 1)))


@pytest.mark.parametrize("elements", ["tet4", "tet10"])
def test_what_is_taken_out_above_a_level_weighs_nothing(elements: str) -> None:
    """The surface of the fluid and that of the cavity may cut each other anywhere."""
    mesh = distorted(box((3, 3, 3)), 0.04)
    out = mesh.centres[:, 0] > 0.5
    mesh = TetMesh(mesh.points, mesh.tetrahedra, element_sets={"out": out})
    gravity = Gravity(direction=(0.3, -0.2, -1.0), density=1040.0, csf_level=0.61, lowest=0.0)
    emptied = model_of(
        mesh, SOFT, loads=[gravity], mechanisms=[Cavity(elements="out", left=1e-9)], elements=elements
    ).external_forces()
    left, nodes, _ = mesh.without(out)
    expected = gravity.nodal_forces(left)
    found = emptied if elements == "tet4" else QuadraticMesh(mesh).at_corners(emptied)
    np.testing.assert_allclose(found[nodes].sum(axis=0), expected.sum(axis=0), rtol=1e-8)
    moments = np.cross(left.points, found[nodes]).sum(axis=0)
    np.testing.assert_allclose(moments, np.cross(left.points, expected).sum(axis=0), rtol=1e-7)
    if elements == "tet4":
        np.testing.assert_allclose(found[nodes], expected, atol=1e-8 * np.abs(expected).sum())


def test_devices() -> None:
    assert find_device("cpu").is_cpu
    with pytest.raises(InputError, match=r"device 'cuda:99': not found on this machine \(there are: cpu"):
        find_device("cuda:99")
    with pytest.raises(InputError, match="device 'abacus': not found"):
        find_device("abacus")


def test_precisions() -> None:
    assert find_precision("double") is DOUBLE
    assert find_precision("single") is SINGLE
    with pytest.raises(InputError, match="precision 'half': expected one of double, single"):
        find_precision("half")


def test_simulator_refuses(device: str) -> None:
    system = System(model_of(MESH, SOFT), device)
    for h in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(InputError, match=r"time step = .*: expected a positive number"):
            Simulator(system, time_step=h)
    with pytest.raises(InputError, match="newton = 0: expected at least one iteration a step"):
        Simulator(system, newton=0)
    with pytest.raises(InputError, match=r"time step = 0\.0 s"):
        Simulator(system).set_time_step(0.0)


@pytest.mark.parametrize("name", ["tolerance", "cg_tolerance"])
@pytest.mark.parametrize("value", [0.0, 1.0, -1.0, math.nan])
def test_equilibrium_options_refuse(name: str, value: float) -> None:
    with pytest.raises(InputError, match=f"equilibrium: {name} = .*: expected a number between 0 and 1"):
        EquilibriumOptions(**{name: value})


@pytest.mark.parametrize(("least", "most"), [(0.0, 1.0), (-0.1, 1.0), (math.nan, 1.0), (0.1, 1.1), (0.5, 0.4)])
def test_load_steps_refuse(least: float, most: float) -> None:
    with pytest.raises(InputError, match=f"equilibrium: min_load_step = {least}, max_load_step = {most}: expected"):
        EquilibriumOptions(min_load_step=least, max_load_step=most)
