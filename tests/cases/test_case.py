"""A case as arguments change it, and the model it becomes."""

import numpy as np
import pytest
from folders import write_folder

from warpbrain.cases.case import Case
from warpbrain.cases.reading import read_case
from warpbrain.errors import InputError
from warpbrain.physics.laws import LAWS, Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.physics.laws.stability import require_stable
from warpbrain.simulation.of_case import model_of

FORCE = 'kind = "force"\ntotal = [0.01, 0.02, -0.05]'


@pytest.fixture
def case(tmp_path) -> Case:
    return read_case(write_folder(tmp_path))


def default_law(case: Case, name: str, mu: float) -> Law:
    """What a law is put in the place of another one as."""
    return case.with_shear_moduli({1: mu}).with_law(name).tissues[1].law


@pytest.mark.parametrize("name", LAWS)
def test_default_laws_have_the_shear_modulus_and_are_stable(case, name):
    law = default_law(case, name, 900.0)
    assert law.name == name
    assert law.shear_modulus == pytest.approx(900.0, rel=1e-14)
    require_stable(law)


def test_default_shapes(case):
    assert default_law(case, "neo-hookean", 900.0) == NeoHookean(900.0)
    assert default_law(case, "mooney-rivlin", 900.0) == MooneyRivlin(225.0, 225.0)
    law = default_law(case, "ogden", 940.0)
    assert isinstance(law, Ogden)
    assert law.alpha == (-4.7,)


@pytest.mark.parametrize("name", LAWS)
def test_another_law_keeps_the_shear_moduli(case, name):
    other = case.with_law(name)
    assert {tissue.law.name for tissue in other.tissues.values()} == {name}
    assert [other.tissues[i].law.shear_modulus for i in (1, 2)] == pytest.approx([1000.0, 3000.0])
    assert other.tissues[2].name == "stiff"
    # what it was made from is as it was
    assert case.tissues[1].law == NeoHookean(1000.0)


def test_the_law_a_case_has_keeps_its_own_shape(tmp_path):
    own = 'model = "mooney-rivlin"\nC1 = 300.0\nC2 = 100.0'
    case = read_case(write_folder(tmp_path, ("mu = 3000.0", own))).with_law("mooney-rivlin")
    assert case.tissues[2].law == MooneyRivlin(300.0, 100.0)
    assert case.tissues[1].law == MooneyRivlin(250.0, 250.0)


def test_an_unknown_law_is_named(case):
    with pytest.raises(InputError, match="model 'fung': expected one of neo-hookean, mooney-rivlin, ogden"):
        case.with_law("fung")


def test_shear_moduli_by_label(case):
    changed = case.with_shear_moduli({2: 500.0})
    assert changed.tissues[2].law == NeoHookean(500.0)
    assert changed.tissues[1] == case.tissues[1]
    assert case.with_shear_moduli({}).tissues == case.tissues


def test_shear_moduli_scale_a_law_and_keep_its_shape(tmp_path):
    own = 'model = "ogden"\nmu = [100.0, -50.0]\nalpha = [2.0, -4.7]'
    law = read_case(write_folder(tmp_path, ("mu = 3000.0", own))).with_shear_moduli({2: 435.0}).tissues[2].law
    assert isinstance(law, Ogden)
    assert law.shear_modulus == pytest.approx(435.0)
    assert law.mu[1] / law.mu[0] == pytest.approx(-0.5)
    assert law.alpha == (2.0, -4.7)


@pytest.mark.parametrize("mu", [0.0, -1.0, np.nan, np.inf])
def test_shear_moduli_must_be_positive(case, mu):
    with pytest.raises(InputError, match=r"mu 2=.*shear modulus of stiff must be positive"):
        case.with_shear_moduli({2: mu})


def test_an_unknown_label_is_named(case):
    with pytest.raises(InputError, match=r"mu 3=5: no tissue 3 in this case \(it has 1 \(soft\), 2 \(stiff\)\)"):
        case.with_shear_moduli({1: 4.0, 3: 5.0})


def test_build_constrains_what_is_fixed_and_moves_what_is_displaced(tmp_path):
    moved = 'kind = "displacement"\nvalue = [0.0, 0.5, -1.5]'
    case = read_case(write_folder(tmp_path, (FORCE, moved)))
    model = model_of(case)
    np.testing.assert_array_equal(case.remaining[1], np.arange(27))
    low, high = model.mesh.node_sets["bottom"], model.mesh.node_sets["top"]
    np.testing.assert_array_equal(model.constrained.all(axis=1), low | high)
    np.testing.assert_array_equal(model.constrained.any(axis=1), low | high)
    np.testing.assert_allclose(model.prescribed[high], np.tile([0.0, 0.0005, -0.0015], (9, 1)))
    np.testing.assert_array_equal(model.prescribed[~high], 0.0)
    assert model.mass == pytest.approx(1000.0 * 2.7e-5)
