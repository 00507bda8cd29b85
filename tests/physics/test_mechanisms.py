"""Every mechanism of the registry: energy, forces and tangent belong together, on their own and all at once."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import energy_at, forces_at, model_of
from material_point import LAWS
from shapes import cube, distorted

from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.simulation.model import ELEMENTS, QUADRATIC, Material
from warpbrain.simulation.system import System

#: One of each kind that acts within a system.
EXAMPLES: dict[str, dict] = {
    "pressure": {"nodes": "all", "value": 300.0},
    "swelling": {"amount": 0.3, "centre": (0.5, 0.5, 0.5), "radius": 0.4},
    "inclusion": {"ratio": 3.0, "elements": "half"},
    "fibres": {"direction": (1.0, 2.0, 0.5), "stiffness": 500.0, "exponent": 2.0, "dispersion": 0.1},
    "falx": {"nodes": "all", "stiffness": 2e3, "thickness": 0.1},
    # inside: the load on a wall that is open has no energy (mechanisms/test_cavity_wall.py); pores are apart from it
    "cavity": {"elements": "inside", "pressure": 150.0, "left": 0.2},
    "drainage": {
        "permeability": 1e-9,
        "pressure": 100.0,
        "exchange": 1e-6,
        "capillary_pressure": 300.0,
        "elements": "around",
    },
    "residual-stress": {"tension": 200.0, "direction": (0.0, 1.0, 1.0), "elements": "half"},
}


#: Those with a memory, or of a fixed place: each has a file of its own.
REMEMBERING = {"viscoelasticity", "contact"}


def test_every_mechanism_that_acts_within_a_system_has_an_example():
    within = {kind for kind, m in mechanisms().items() if not issubclass(m, Load) and not _of_the_model(m)}
    assert within == set(EXAMPLES) | REMEMBERING


def _of_the_model(mechanism: type[Mechanism]) -> bool:
    return any(hasattr(mechanism, name) for name in ("remaining", "substitute"))


def body(*kinds: str, precision: str = "double", device: str = "cpu", elements: str = "tet4") -> System:
    mesh: TetMesh = distorted(cube(3), 0.05, tissues=2)
    middles = mesh.points[mesh.tetrahedra].mean(axis=1)
    inside = (np.abs(cube(3).points[mesh.tetrahedra] - 0.5) < 0.2).all(axis=(1, 2))
    sets = {"half": middles[:, 0] > 0.5, "inside": inside, "around": ~inside}
    mesh = replace(mesh, node_sets={"all": np.ones(len(mesh.points), dtype=bool)}, element_sets=sets)
    materials = Material(LAWS["neo-hookean"]), Material(LAWS["ogden -4.7"], 0.4, "uncoupled")
    acts = [mechanisms()[kind](**EXAMPLES[kind]) for kind in kinds]
    return System(model_of(mesh, *materials, mechanisms=acts, elements=elements), device, precision)


def state(system: System) -> np.ndarray:
    # midside nodes are half as far from each other
    size = 0.03 if system.quadratic is None else 0.015
    return size * np.random.default_rng(1).uniform(-1.0, 1.0, (system.size, 3))


def acting_on(elements: str) -> list[str]:
    """Kinds of the examples that can act on elements."""
    return [kind for kind in EXAMPLES if elements not in QUADRATIC or acts_on_quadratic_elements(mechanisms()[kind])]


def acts_on_quadratic_elements(mechanism: type[Mechanism]) -> bool:
    """What has no forces of its own acts through the tissue's law, whatever its elements are."""
    return mechanism.quadratic or not hasattr(mechanism, "bind")


@pytest.mark.parametrize("kind", [kind for kind in EXAMPLES if kind not in acting_on("tet10")])
def test_what_knows_no_midside_nodes_refuses_quadratic_elements(kind):
    with pytest.raises(InputError, match=f"{kind}: cannot act on elements 'tet10'"):
        body(kind, elements="tet10")


@pytest.mark.parametrize(
    ("kind", "elements"),
    [(kind, elements) for elements in ELEMENTS for kind in (*acting_on(elements), "all at once")],
)
def test_forces_are_the_slope_of_the_energy_and_the_tangent_that_of_the_forces(kind, elements, device):
    system = body(*(acting_on(elements) if kind == "all at once" else (kind,)), device=device, elements=elements)
    u, d = state(system), np.random.default_rng(2).normal(size=(system.size, 3))
    h = 5e-6
    slope = (energy_at(system, u + h * d) - energy_at(system, u - h * d)) / (2.0 * h)
    assert np.vdot(forces_at(system, u), d) == pytest.approx(slope, rel=1e-6)
    change = (forces_at(system, u + h * d) - forces_at(system, u - h * d)) / (2.0 * h)
    system.u.assign(u)
    system.evaluate_tangents()
    found = system.stiffness_times(d)
    assert np.abs(found - change).max() <= 1e-6 * np.abs(change).max()


@pytest.mark.parametrize("kind", EXAMPLES)
def test_a_body_turned_and_moved_is_the_same_body(kind, device):
    """Forces turn with the body, but for directions that are fixed to it."""
    system = body(kind, device=device)
    Q = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    Q *= np.sign(np.linalg.det(Q))
    x = system.model.mesh.points
    u = state(system)
    turned = (x + u) @ Q.T + [0.1, -0.2, 0.3] - x
    assert energy_at(system, turned) == pytest.approx(energy_at(system, u), rel=1e-9)
    expected = forces_at(system, u) @ Q.T
    assert np.abs(forces_at(system, turned) - expected).max() <= 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("kind", "elements"),
    # kernels of quadratic elements take as long to compile as all else here
    [
        *((kind, "tet4") for kind in EXAMPLES),
        *(pytest.param(kind, "tet10", marks=pytest.mark.slow(4)) for kind in ("pressure", "fibres")),
    ],
)
def test_single_precision_agrees_with_double(kind, elements, device):
    systems = [body(kind, precision=precision, device=device, elements=elements) for precision in ("single", "double")]
    found, expected = (forces_at(system, state(system)) for system in systems)
    assert np.abs(found - expected).max() <= 1e-4 * np.abs(expected).max()


@pytest.mark.parametrize("kind", EXAMPLES)
def test_without_a_share_it_does_nothing(kind, device):
    if kind in ("inclusion", "falx"):
        pytest.skip("what is there is there, whatever the load")
    plain, system = body(device=device), body(kind, device=device)
    system.set_load(0.0)
    u = state(system)
    expected = forces_at(plain, u)
    assert np.abs(forces_at(system, u) - expected).max() <= 1e-12 * np.abs(expected).max()
