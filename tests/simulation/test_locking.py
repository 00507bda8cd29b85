"""Which elements a model has if nobody asks for any, and what is said of those that lock."""

import numpy as np
import pytest
from bodies import model_of
from shapes import cube

from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.locking import (
    MEASURED,
    choose_elements,
    elements_of_fits,
    locking_sentences,
    on_linear_elements,
)
from warpbrain.simulation.model import ELEMENTS, Material, Model


def body(*poisson: float, **options: object) -> Model:
    mesh = cube(1)
    tissue = 1 + np.arange(len(mesh.tetrahedra)) % len(poisson)
    mesh = TetMesh(mesh.points, mesh.tetrahedra, tissue)
    return model_of(mesh, *(Material(NeoHookean(1000.0), nu) for nu in poisson), **options)


def test_the_tissue_that_is_nearest_to_incompressible_decides() -> None:
    assert choose_elements(body(0.45, 0.49))[0] == "tet4"
    elements, reason = choose_elements(body(0.45, 0.4901))
    assert elements == "tet10-mixed" and "nu = 0.4901 is above 0.49" in reason


def test_what_knows_no_midside_nodes_has_averaged_ones() -> None:
    model = body(0.495, mechanisms=[Viscoelasticity(moduli=(1.0,), times=(1.0,))])
    elements, reason = choose_elements(model, ["--mesh-error"])
    assert elements == "tet4-averaged"
    assert reason.endswith("not tet10-mixed because of --mesh-error, viscoelasticity")


@pytest.mark.parametrize("poisson", MEASURED)
@pytest.mark.parametrize("elements", ELEMENTS)
def test_who_is_3_percent_too_stiff_says_so(elements: str, poisson: float) -> None:
    """Averaged and quadratic ones where tissue is nearly incompressible, plain ones always."""
    said = locking_sentences(elements, poisson)
    stiffer = -MEASURED[poisson][elements]
    assert bool(said) == (stiffer >= 0.03 and (elements == "tet4" or poisson > 0.49))
    for sentence in said:
        assert f"at nu = {poisson:g} " in sentence and f" {100.0 * stiffer:.0f} % less" in sentence


def test_what_has_linear_tetrahedra_only_says_what_that_does() -> None:
    assert on_linear_elements(0.49, "an estimate") == []
    [said] = on_linear_elements(0.499, "an estimate")
    assert "8 % less" in said and said.endswith(
        "an estimate has no other elements, and allows for what smaller ones show"
    )
    assert [elements_of_fits(poisson) for poisson in (0.45, 0.49, 0.499)] == ["tet4", "tet4", "tet4-averaged"]
