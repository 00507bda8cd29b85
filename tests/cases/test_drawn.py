"""Laws of a case from the generative model: the middle of its prior, or a draw."""

import pytest
from folders import write_folder

from warpbrain.cases.case import Case
from warpbrain.cases.drawn import with_prior_draw, with_prior_middle
from warpbrain.cases.reading import read_case
from warpbrain.cases.shipped import find_case
from warpbrain.cases.writing import write_case
from warpbrain.errors import InputError, SolveError
from warpbrain.gp import sampling
from warpbrain.gp.sampling import draw_laws, law_of_curve
from warpbrain.gp.trained import trained
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.run import why_not

GREY, WHITE, BRAIN = (f"hyperelastic/{anatomy}" for anatomy in ("grey matter", "white matter", "brain"))
SOFT = ("mu = 1000.0", f'mu = 1000.0\nprior = "{GREY}"')
STIFF = ("mu = 3000.0", f'model = "ogden"\nmu = "prior"\nprior = "{WHITE}"')


@pytest.fixture
def case(tmp_path) -> Case:
    """Grey matter of a known modulus, white matter of an unknown one."""
    return read_case(write_folder(tmp_path, SOFT, STIFF))


def test_an_unknown_law_is_the_middle_of_its_prior(case):
    expected = law_of_curve(trained(), WHITE, law="ogden").law()
    assert case.tissues[2].law is None
    assert case.tissues[2].known_law == expected
    assert model_of(case).materials[2].law == expected
    assert why_not(case) == ""
    found = with_prior_middle(case)
    assert found.labels == (2,) and found.drawn is None
    assert found.case.tissues[2].law == expected
    assert found.case.tissues[1].law == NeoHookean(1000.0)


def test_the_middle_by_another_model(case):
    model = trained("coregionalised")
    found = with_prior_middle(case, model)
    assert found.model is model
    assert found.case.tissues[2].law == law_of_curve(model, WHITE, law="ogden").law() != case.tissues[2].known_law


def test_the_middle_is_of_the_law_that_is_asked_for(case):
    assert case.with_law("mooney-rivlin").tissues[2].known_law.name == "mooney-rivlin"
    # a modulus that is given is used
    assert with_prior_middle(case.with_shear_moduli({2: 500.0})).labels == ()


def test_a_case_is_written_as_it_was_read(case, tmp_path):
    write_case(tmp_path / "copy", case)
    assert read_case(tmp_path / "copy").tissues == case.tissues


def test_a_draw_gives_every_law(case):
    found = with_prior_draw(case, 7)
    expected = draw_laws(trained(), [GREY, WHITE], ["neo-hookean", "ogden"], 7)
    assert found.labels == (1, 2)
    assert tuple(found.case.tissues[label].law for label in (1, 2)) == expected.laws == found.drawn.laws
    assert with_prior_draw(case, 7).case.tissues == found.case.tissues
    assert with_prior_draw(case, 7, seed=1).case.tissues != found.case.tissues
    # what it was made from is as it was
    assert case.tissues[2].law is None
    assert found.case.tissues[2].name == "stiff"


def test_tissues_of_one_group_are_one_tissue(tmp_path):
    other = ("mu = 3000.0", f'mu = 3000.0\nprior = "{GREY}"')
    found = with_prior_draw(read_case(write_folder(tmp_path, SOFT, other)), 0)
    assert found.case.tissues[1].law == found.case.tissues[2].law


@pytest.mark.parametrize(("tissue", "groups"), [("multi", (GREY, WHITE)), ("single", (BRAIN,))])
def test_shipped_cases_have_priors(tissue, groups):
    found = with_prior_draw(find_case("0529", tissue), 7)
    assert found.drawn.groups == groups


def test_a_tissue_without_a_group_is_named(tmp_path):
    folder = write_folder(tmp_path, SOFT)
    with pytest.raises(InputError) as error:
        with_prior_draw(read_case(folder), 0)
    assert str(error.value).startswith(f"{folder / 'case.toml'}: [tissue.2] prior: missing, but a draw is of a group: ")


def test_a_group_without_studies_is_named(tmp_path):
    folder = write_folder(tmp_path, ("mu = 1000.0", 'mu = "prior"\nprior = "MRE/abnormal"'))
    case = read_case(folder)
    for refused in (lambda: with_prior_draw(case, 0), lambda: with_prior_middle(case)):
        with pytest.raises(InputError) as error:
            refused()
        said = str(error.value)
        assert said.startswith(f"{folder / 'case.toml'}: [tissue.1] prior: ")
        assert "has seen no study of 'MRE/abnormal': expected one of MRE/grey matter, " in said
    with pytest.raises(InputError, match=r'soft: mu = "prior": group .MRE/abnormal.'):
        _ = case.tissues[1].known_law
    assert "MRE/abnormal" in why_not(case)


def test_a_draw_that_finds_no_stable_law_names_the_case(case, monkeypatch):
    monkeypatch.setattr(sampling, "unstable", lambda *_: "never")
    with pytest.raises(SolveError, match=rf"{case.path}: draw 0 of seed 0: all of 200 attempts are unstable"):
        with_prior_draw(case, 0)
