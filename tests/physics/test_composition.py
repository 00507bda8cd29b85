"""Every pair of mechanisms against one independent energy, or refused."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mechanism_pairs import pairs
from numpy.typing import NDArray
from shapes import cube, distorted
from total_potential import DENSITY, MU, POISSON, STEP, TotalPotential
from verification_rows import Row

from warpbrain.mesh import TetMesh, boundary_faces
from warpbrain.physics.composition import CompositionError, require_composable, require_left
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanism import Facts, Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.regions import elements_with
from warpbrain.simulation.model import ELEMENTS, QUADRATIC, Material, Model, with_mechanisms
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]

#: One of each kind, and what is other of a second one of it.
EXAMPLES: dict[str, tuple[dict, dict]] = {
    "asymmetry": ({"exponent": -6.0}, {}),
    "cavity": ({"elements": "closed", "pressure": 150.0, "left": 0.2}, {}),
    "compressibility": ({"poisson": 0.3}, {}),
    "contact": ({"nodes": "below", "state": "sliding"}, {"nodes": "wall"}),
    "drainage": (
        {"permeability": 1e-4, "storage": 1e-5, "drained": "below", "elements": "around"},
        {},
    ),
    "falx": ({"nodes": "middle", "stiffness": 3e4, "thickness": 0.01}, {"nodes": "all", "stiffness": 2e4}),
    "fibres": (
        {"direction": (1.0, 2.0, 0.5), "stiffness": 500.0, "exponent": 3.0, "dispersion": 0.1},
        {"direction": (0.0, 0.0, 1.0), "elements": "half"},
    ),
    "gravity": ({"direction": (1.0, 0.0, -2.0), "density": DENSITY}, {}),
    "inclusion": ({"ratio": 10.0, "elements": "half"}, {"ratio": 0.3, "elements": "closed"}),
    "pressure": ({"nodes": "all", "value": 200.0}, {"value": -50.0}),
    "resection": ({"elements": "taken"}, {}),
    "residual-stress": (
        {"tension": 300.0, "direction": (0.0, 1.0, 1.0), "elements": "half"},
        {"direction": (1.0, 0.0, 0.0), "elements": "closed"},
    ),
    "swelling": ({"amount": 0.3, "elements": "half"}, {"amount": -0.1, "elements": "around"}),
    "traction": ({"centre": (0.5, 0.5, 1.0), "value": (50.0, 0.0, -200.0), "radius": 0.8}, {"centre": (0.0, 0.5, 0.5)}),
    "viscoelasticity": ({"moduli": (2.0, 0.5), "times": (0.1, 4.0)}, {}),
}
#: Kinds of elements without midside nodes.
LINEAR = ("tet4", "tet4-averaged")
PAIRS = [pair for pair in pairs() if pair.potential]


@cache
def body() -> TetMesh:
    """A distorted cube; what is closed has no face on the surface, nor beside what is taken."""
    plain, mesh = cube(2), distorted(cube(2), 0.04)
    surface = elements_with(plain, plain.boundary)
    middles = plain.points[plain.tetrahedra].mean(axis=1)
    closed = ~surface & (middles[:, 0] < 0.5)
    beside = elements_with(plain, boundary_faces(plain.tetrahedra[closed]))
    taken = (middles[:, 0] > 0.5) & (middles[:, 2] > 0.5) & ~beside
    sets = {"closed": closed, "around": ~closed, "half": middles[:, 1] > 0.5, "taken": taken}
    assert all(members.any() for members in sets.values())
    x, _, z = plain.points.T
    nodes = {"all": np.ones(len(x), dtype=bool), "below": z == 0.0, "wall": x == 0.0, "middle": x == 0.5}
    return replace(mesh, node_sets=nodes, element_sets=sets)


def acting_in(first: str, second: str) -> list[Mechanism]:
    values, others = EXAMPLES[first]
    second_values = {**values, **others} if first == second else EXAMPLES[second][0]
    return [mechanisms()[first](**values), mechanisms()[second](**second_values)]


def model_of(acting: Sequence[Mechanism], elements: str = "tet4") -> Model:
    left = require_left(acting, body())
    return with_mechanisms(Model(left, {1: Material(NeoHookean(MU), POISSON)}, DENSITY, elements=elements), acting)


def displacements(mesh: TetMesh) -> tuple[Floats, Floats, Floats]:
    """At the end of a first step, in a second one, and a direction."""
    found = np.random.default_rng(0).uniform(-1.0, 1.0, (3, len(mesh.points), 3))
    return 0.02 * found[0], 0.03 * found[1], found[2]


def evaluated(model: Model, device: str) -> tuple[System, Floats, Floats]:
    """The system, forces less loads (n, 3) [N], and tangent times the direction, in the second of two steps."""
    before, u, d = displacements(model.mesh)
    system = System(model, device)
    system.set_time_step(STEP)
    system.u.assign(before)
    system.advance()
    system.u.assign(u)
    system.evaluate_tangents()
    system.gather_forces()
    return system, system.internal.numpy() - model.external_forces(), system.stiffness_times(d)


def walls(model: Model, device: str) -> tuple[Floats, Floats]:
    """What contact adds by itself: forces and tangent times the direction, for the stiffness of its penalty here."""
    touching = [m for m in model.mechanisms if m.kind == "contact"]
    plain = Model(model.mesh, {1: Material(NeoHookean(MU), POISSON)}, DENSITY)
    _, f0, K0 = evaluated(plain, device)
    force, tangent = np.zeros_like(f0), np.zeros_like(f0)
    for contact in touching:
        alone, f, K = evaluated(replace(plain, mechanisms=(contact,)), device)
        (term,) = alone.terms
        # a penalty is relative to the tissue's moduli
        ratio = (MU + max(m.volumetric_modulus for m in model.materials.values())) / (
            MU + plain.materials[1].volumetric_modulus
        )
        force, tangent = force + ratio * (f - f0), tangent + ratio * (K - K0)
        assert term.stiffness > 0.0
    return force, tangent


def expected(model: Model, acting: Sequence[Mechanism], device: str) -> tuple[Floats, Floats]:
    """The same from the independent energy."""
    before, u, d = displacements(model.mesh)
    energy = TotalPotential(model.mesh, acting, before)
    force, tangent = walls(model, device)
    for load in acting:
        # the shape of a traction on the surface is another test's
        if load.kind == "traction":
            force = force - load.nodal_forces(model.mesh)
    h = 1e-6
    tangent = tangent + (energy.forces(u + h * d) - energy.forces(u - h * d)) / (2.0 * h)
    return force + energy.forces(u), tangent


def largest(found: Floats, reference: Floats) -> float:
    return float(np.abs(found - reference).max() / np.abs(reference).max())


def test_every_mechanism_has_an_example() -> None:
    assert set(EXAMPLES) == set(mechanisms())


def error_of(acting: Sequence[Mechanism], device: str) -> float:
    model = model_of(acting)
    _, forces, tangent = evaluated(model, device)
    reference, reference_tangent = expected(model, acting, device)
    return max(largest(forces, reference), largest(tangent, reference_tangent))


@pytest.mark.parametrize("kind", dict.fromkeys(pair.kinds[0] for pair in PAIRS))
def test_a_pair_is_one_energy(kind: str, device: str, verify: Row) -> None:
    """Forces and tangent in the second of two time steps, so that what remembers has something to remember."""
    errors = {pair.kinds: error_of(acting_in(*pair.kinds), device) for pair in PAIRS if pair.kinds[0] == kind}
    worst = max(errors, key=lambda kinds: errors[kinds])
    others = ", ".join(second for _, second in errors)
    claim = f"{kind} with each of {others}: forces and tangent stiffness are those of one energy"
    reference = f"total potential in NumPy, complex-step and central differences (worst: {worst[1]})"
    verify(claim, reference, errors[worst], 1e-9)


def test_all_together_are_one_energy(device: str, verify: Row) -> None:
    acting = [mechanisms()[kind](**values) for kind, (values, _) in EXAMPLES.items()]
    claim = "all mechanisms at once: forces and tangent stiffness are those of one energy"
    reference = "total potential in NumPy, complex-step and central differences"
    verify(claim, reference, error_of(acting, device), 1e-9)


#: Mechanisms of which forces or a tangent are another if they are composed in another way.
@pytest.mark.parametrize("kind", ["fibres", "viscoelasticity", "residual-stress", "swelling"])
@pytest.mark.parametrize("elements", ELEMENTS)
def test_energy_of_a_uniform_strain(kind: str, elements: str, device: str) -> None:
    """Where strain is uniform quadratic and averaged elements have the energy of plain ones."""
    if elements not in LINEAR and kind == "viscoelasticity":
        pytest.skip("does not act on midside nodes")
    acting = [mechanisms()[name](**EXAMPLES[name][0]) for name in dict.fromkeys(("inclusion", "swelling", kind))]
    if elements not in ("tet4", "tet10"):
        # around a node the means of factors and of growth count: the same everywhere
        acting[:2] = [mechanisms()["inclusion"](ratio=10.0), mechanisms()["swelling"](amount=0.3)]
    model = model_of(acting, elements)
    A = 0.1 * np.random.default_rng(1).uniform(-1.0, 1.0, (3, 3))
    nodes = model.node_mesh.points
    system = System(model, device)
    system.set_time_step(STEP)
    system.advance()
    system.u.assign(nodes @ A.T)
    energy = TotalPotential(model.mesh, acting, np.zeros_like(model.mesh.points))(model.mesh.points @ A.T)
    assert system.energy()[0] == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize("elements", ELEMENTS)
def test_what_swells_freely_is_without_stress(elements: str, device: str, verify: Row) -> None:
    """Whatever the tissue is made of: no tension, which is a stress by itself."""
    # another law on quadratic elements: test_mechanisms.py
    kinds = ("fibres", "inclusion", "swelling", *(("asymmetry", "viscoelasticity") if elements in LINEAR else ()))
    acting = [mechanisms()[kind](**EXAMPLES[kind][0]) for kind in kinds if kind != "swelling"]
    model = model_of([*acting, mechanisms()["swelling"](amount=0.3)], elements)
    system = System(model, device)
    system.set_time_step(STEP)
    system.advance()
    system.u.assign((np.cbrt(1.3) - 1.0) * model.node_mesh.points)
    system.evaluate_forces()
    system.gather_forces()
    # relative to the modulus, on the area of an element's face
    error = max(np.abs(system.internal.numpy()).max() / 0.25, np.abs(system.stresses()).max()) / MU
    verify(f"free swelling with {', '.join(kinds)} ({elements}): no stress", "closed form", float(error), 1e-12)


def test_swelling_in_time_strains_no_branch(device: str) -> None:
    """What remembers sees the elastic stress, of each time by the growth of that time."""
    swelling = mechanisms()["swelling"](amount=0.3, ramp=[(0.0, 0.0), (2.0, 1.0)])
    model = model_of([swelling, mechanisms()["viscoelasticity"](**EXAMPLES["viscoelasticity"][0])])
    system = System(model, device)
    system.set_time_step(STEP)
    for time in (0.5, 1.0, 2.0):
        system.set_load(time=time)
        system.u.assign((np.cbrt(1.0 + 0.15 * time) - 1.0) * model.mesh.points)
        system.evaluate_forces()
        system.gather_forces()
        assert np.abs(system.internal.numpy()).max() < 1e-12 * MU
        system.advance()


def test_what_says_a_law_does_so_in_any_order() -> None:
    both = acting_in("asymmetry", "compressibility")
    assert model_of(both).materials == model_of(both[::-1]).materials


@pytest.mark.parametrize(
    ("kind", "elements"),
    [
        # kernels of another law on quadratic elements take as long to compile as all else here
        pytest.param(kind, elements, marks=pytest.mark.slow(2) if kind == "asymmetry" and elements in QUADRATIC else [])
        for kind in ("asymmetry", "compressibility", "fibres", "swelling", "viscoelasticity")
        for elements in ELEMENTS
        if elements in LINEAR or kind != "viscoelasticity"  # does not act on midside nodes
    ],
)
def test_an_inclusion_multiplies_all_moduli(kind: str, elements: str, device: str, verify: Row) -> None:
    """Everywhere: all forces of the tissue are as many times as large."""
    other = mechanisms()[kind](**EXAMPLES[kind][0])
    forces, stresses = [], []
    for acting in ([other], [other, mechanisms()["inclusion"](ratio=10.0)]):
        model = model_of(acting, elements)
        system = System(model, device)
        system.set_time_step(STEP)
        system.advance()
        system.u.assign(0.01 * np.random.default_rng(0).uniform(-1.0, 1.0, model.node_mesh.points.shape))
        system.evaluate_forces()
        system.gather_forces()
        forces.append(system.internal.numpy())
        stresses.append(system.stresses())
    error = max(largest(forces[1], 10.0 * forces[0]), largest(stresses[1], 10.0 * stresses[0]))
    claim = f"inclusion everywhere with {kind} ({elements}): forces and stresses times the ratio"
    verify(claim, "definition", error, 1e-12)


def test_a_stress_is_that_of_the_energy(device: str) -> None:
    """`V P = dPi/dF` of each element, of all that the tissue is made of."""
    kinds = ("fibres", "inclusion", "residual-stress", "swelling", "viscoelasticity")
    acting = [mechanisms()[kind](**EXAMPLES[kind][0]) for kind in kinds]
    model = model_of(acting)
    system, forces, _ = evaluated(model, device)
    nodal = np.zeros_like(forces)
    gradients = TotalPotential(model.mesh, acting, np.zeros_like(forces)).gradients
    own = np.einsum("e,eij,eaj->eai", model.mesh.volumes, system.stresses(), gradients)
    np.add.at(nodal, model.mesh.tetrahedra, own)
    assert largest(nodal, forces) < 1e-12


def test_levels_are_counted_from_the_whole_anatomy() -> None:
    """A resection of the lowest part does not move the fluid."""
    mesh = body()
    lower = mesh.points[mesh.tetrahedra].min(axis=1)[:, 2] < 0.1
    mesh = replace(mesh, element_sets={"gone": lower})
    facts = Facts(mesh, (0.0, 0.0, -1.0), DENSITY, (mechanisms()["resection"](elements="gone"),))
    assert facts.left.points[:, 2].min() > mesh.points[:, 2].min() + 0.1
    found = mechanisms()["gravity"].of_case({"csf_level": 0.5}, facts)
    assert found.lowest == mesh.points[:, 2].min()


# -- refused --------------------------------------------------------------------------------------------------------


def everywhere(kind: str) -> Mechanism:
    """A mechanism of a kind that acts on everything."""
    values = EXAMPLES[kind][0]
    return mechanisms()[kind](**{key: "" if key == "elements" else value for key, value in values.items()})


@pytest.mark.parametrize("pair", [pair for pair in pairs() if "cavity" in pair.kinds], ids=lambda p: "-".join(p.kinds))
def test_what_acts_on_tissue_that_is_taken_out_is_refused(pair) -> None:
    """Where the table says so, and nowhere else."""
    kind = next((kind for kind in pair.kinds if kind != "cavity"), "cavity")
    if kind in ("cavity", "resection"):
        return
    cavity, other = mechanisms()["cavity"](elements="half"), everywhere(kind)
    if pair.refused:
        with pytest.raises(CompositionError, match=f"cavity and {kind} cannot act together: {kind} acts on tissue"):
            require_composable([other, cavity], body())
        with pytest.raises(CompositionError):
            model_of([other, cavity])
    else:
        require_composable([other, cavity], body())


@pytest.mark.parametrize(
    "pair", [pair for pair in pairs() if "resection" in pair.kinds], ids=lambda p: "-".join(p.kinds)
)
def test_what_acts_on_nothing_that_is_left_is_refused(pair) -> None:
    kind = next((kind for kind in pair.kinds if kind != "resection"), "resection")
    if kind == "resection":
        return
    mesh, values = body(), dict(EXAMPLES[kind][0])
    lower = mesh.node_sets["below"][mesh.tetrahedra].any(axis=1)
    taken = mesh.element_sets["half"]
    if "nodes" in values:
        values["nodes"], taken = "below", lower
    elif kind == "traction":
        values |= {"radius": 0.1}
        taken = np.linalg.norm(mesh.points - values["centre"], axis=1)[mesh.tetrahedra].min(axis=1) < 0.3
    elif "elements" in mechanisms()[kind].parameters():
        values["elements"] = "half"
    acting = [mechanisms()["resection"](elements="gone"), mechanisms()[kind](**values)]
    mesh = replace(mesh, element_sets={**mesh.element_sets, "gone": taken})
    if not pair.refused:
        require_left(acting, mesh)
        return
    with pytest.raises(CompositionError, match=f"resection and {kind} cannot act together: in the tissue that is left"):
        require_left(acting, mesh)
