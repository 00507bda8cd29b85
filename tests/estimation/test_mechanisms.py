"""An estimate's forward model with every mechanism in the case: on a finer mesh, and differentiated."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import SIDE, WHITE, block, truth

from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.estimation.finer_mesh import DiscretisationError, FinerMesh, discretisation_error
from warpbrain.estimation.forward import Forward
from warpbrain.estimation.parameters import Parameters
from warpbrain.mesh.refinement import refined
from warpbrain.physics.mechanism import Removing
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.mechanisms.asymmetry import Asymmetry
from warpbrain.physics.mechanisms.compressibility import Compressibility

MIDDLE = (0.5 * SIDE, 0.5 * SIDE, 0.5 * SIDE)
EXAMPLES: dict[str, dict] = {
    "cavity": {"elements": "part", "pressure": 20.0, "left": 0.2},
    "compressibility": {"poisson": 0.4},
    "contact": {"nodes": "wall", "state": "lifting", "friction": 0.1},
    "drainage": {"permeability": 1e-9, "exchange": 1e-6, "capillary_pressure": 200.0},
    "falx": {"nodes": "sheet", "stiffness": 1e5},
    "fibres": {"direction": (1.0, 0.0, 1.0), "stiffness": 500.0},
    "gravity": {"direction": (1.0, 0.0, -1.0), "density": 1000.0, "csf_level": 0.02},
    "inclusion": {"ratio": 3.0, "centre": MIDDLE, "radius": 0.01},
    "pressure": {"nodes": "wall", "value": 30.0},
    "resection": {"elements": "part"},
    "residual-stress": {"tension": 50.0, "direction": (0.0, 0.0, 1.0), "elements": "part"},
    "swelling": {"amount": 0.1, "elements": "part"},
    "traction": {"centre": (0.5 * SIDE, 0.5 * SIDE, SIDE), "value": (0.0, 0.0, -200.0), "radius": 0.02},
    "viscoelasticity": {"moduli": (1.0,), "times": (1.0,)},
}
THETA = np.log([1000.0])


def case_with(kind: str) -> Case:
    """A pushed block with the sets that mechanisms act on."""
    case = block({"brain": WHITE}, "pushed")
    mesh = case.mesh
    x = mesh.points[:, 0]
    part = mesh.points[mesh.tetrahedra].mean(axis=1).min(axis=1) > 0.6 * SIDE
    sheet = np.abs(x - SIDE / 3.0) < 1e-9
    node_sets = {**mesh.node_sets, "wall": x > SIDE - 1e-9, "sheet": sheet}
    mesh = replace(mesh, node_sets=node_sets, element_sets={"part": part})
    return replace(case, mesh=mesh, mechanisms=(mechanisms()[kind](**EXAMPLES[kind]),))


def error_of_mesh(case: Case) -> DiscretisationError:
    forward = Forward(case, THETA, "cpu")
    state = forward.solve(THETA)
    return discretisation_error([FinerMesh("cpu")], forward, state, forward.differentiate(state))


def test_every_mechanism_that_an_estimate_can_have_is_here() -> None:
    assert set(EXAMPLES) == set(mechanisms()) - {"asymmetry"}


@pytest.mark.parametrize("kind", EXAMPLES)
def test_the_error_of_the_mesh_is_the_difference_of_two_meshes(kind: str) -> None:
    case = case_with(kind)
    error = error_of_mesh(case)
    # a force shared by nodes is spread as the coarse mesh spreads it: not compared here
    loose = replace(case, boundaries=case.boundaries[:1])
    beside = error_of_mesh(loose)
    coarse, _ = case.remaining
    left = tuple(m for m in case.mechanisms if not isinstance(m, Removing))
    plain, smaller = (truth(replace(loose, mesh=mesh, mechanisms=left)) for mesh in (coarse, refined(coarse)[0]))
    expected = smaller.u[: len(coarse.points)] - plain.u
    assert np.abs(beside.change.u - expected).max() <= 1e-3 * np.abs(plain.u).max() + 1e-9
    moved = np.sqrt(np.mean(np.sum(Forward(case, THETA, "cpu").solve(THETA).u ** 2, axis=1)))
    assert error.change.size < 0.5 * moved


@pytest.mark.parametrize("kind", ["compressibility", "contact", "drainage", "pressure", "swelling"])
def test_derivatives_by_tissue_with_a_mechanism(kind: str) -> None:
    """A state that is not the last one has its own contacts again."""
    forward = Forward(case_with(kind), THETA, "cpu")
    state = forward.solve(THETA)
    beside = [forward.solve(THETA + step) for step in (1e-2, -1e-2)]
    expected = (beside[0].u - beside[1].u) / 2e-2
    found = forward.differentiate(state)[0][0]
    assert np.linalg.norm(found - expected) < 1e-2 * np.linalg.norm(expected)


def test_another_compressibility_is_what_tissue_has_then() -> None:
    case = case_with("compressibility")
    assert Parameters.of(case).poisson == 0.4
    plain = replace(case, mechanisms=(), poisson=0.4)
    np.testing.assert_array_equal(
        Forward(case, THETA, "cpu").solve(THETA).u, Forward(plain, THETA, "cpu").solve(THETA).u
    )


def test_another_law_is_refused() -> None:
    case = replace(case_with("pressure"), mechanisms=(Compressibility(poisson=0.4), Asymmetry(exponent=-5.0)))
    with pytest.raises(InputError, match="'asymmetry': says what law tissues have"):
        Parameters.of(case)
