"""Laws of curves of the generative model: the paper's, drawn ones, and what is redrawn."""

import itertools

import numpy as np
import pytest

from warpbrain.errors import InputError, SolveError
from warpbrain.gp import sampling
from warpbrain.gp.sampling import (
    METAMODELS,
    draw_laws,
    law_of_curve,
    middle_law,
    rejection_rate,
    unstable,
    usual_stretches,
)
from warpbrain.gp.trained import KINDS, trained

GREY, WHITE, BRAIN = (f"hyperelastic/{anatomy}" for anatomy in ("grey matter", "white matter", "brain"))


@pytest.mark.parametrize("kind", KINDS)
def test_a_curve_further_up_is_a_stiffer_law(kind):
    moduli = [law_of_curve(trained(kind), BRAIN, k).shear_modulus for k in (-2.0, -1.0, 0.0, 1.0, 2.0)]
    assert np.all(np.diff(np.log(moduli)) > 0.1)


@pytest.mark.parametrize("law", METAMODELS)
def test_the_law_is_the_one_that_a_curve_was_made_from(law, monkeypatch):
    """A model whose curves are those of a law gives the law back: offsets do not get between them."""
    metamodel = METAMODELS[law]
    values = {"neo-hookean": (700.0,), "mooney-rivlin": (200.0, 100.0), "ogden": (-300.0, -6.0)}[law]
    model = trained()
    monkeypatch.setattr(
        type(model), "curve", lambda self, group, l, k: np.log(metamodel.energy(np.asarray(l), values) + 1e-4)
    )
    fitted = law_of_curve(model, GREY, law=law)
    assert fitted.values == pytest.approx(values, rel=1e-6)
    assert fitted.law() == metamodel.law(fitted.values)


def test_the_papers_process_is_fitted_as_in_the_paper():
    """`ln(Psi + 1e-3)` against the curve as it is, which for a neo-Hookean law is a scale that one search finds."""
    model = trained("coregionalised", "as_published")
    l = usual_stretches(BRAIN)
    assert len(l) == 101 and (l[0], l[-1]) == (0.6, 1.4)
    y = model.curve(BRAIN, l, 1.0)
    moduli = law_of_curve(model, BRAIN, 1.0).shear_modulus * np.array([0.999, 1.0, 1.001])
    costs = [np.sum((np.log(0.5 * mu * (l**2 + 2.0 / l - 3.0) + 1e-3) - y) ** 2) for mu in moduli]
    assert np.argmin(costs) == 1


def test_a_draw_is_the_same_whatever_else_is_drawn():
    model = trained()
    draws = [draw_laws(model, [GREY, WHITE], "ogden", number, seed=3) for number in range(5)]
    assert [draw.number for draw in draws] == [0, 1, 2, 3, 4]
    again = draw_laws(model, [GREY, WHITE], "ogden", 4, seed=3)
    assert again.laws == draws[4].laws and again.rejected == draws[4].rejected
    assert len({draw.laws for draw in draws}) == 5
    assert draw_laws(model, [GREY, WHITE], "ogden", 4, seed=4).laws != again.laws


def test_tissues_are_drawn_together():
    """What the groups share moves both: a soft brain has soft grey and white matter."""
    draws = [draw_laws(trained(), [GREY, WHITE], "neo-hookean", number) for number in range(200)]
    moduli = np.log([draw.shear_moduli for draw in draws])
    assert 0.4 < np.corrcoef(moduli.T)[0, 1] < 0.9


def test_groups_of_different_ranges_are_one_draw():
    draw = draw_laws(trained(), [GREY, BRAIN], "neo-hookean", 2)
    for stretches, curve, group in zip(draw.stretches, draw.curves, draw.groups, strict=True):
        np.testing.assert_array_equal(stretches, usual_stretches(group))
        row = [GREY, BRAIN].index(group)
        np.testing.assert_allclose(curve, trained().draw([GREY, BRAIN], stretches, 2)[row], atol=1e-9)


def test_tissues_of_one_group_share_the_curve():
    draw = draw_laws(trained(), [GREY, WHITE, GREY], ["neo-hookean", "ogden", "ogden"], 0)
    assert [law.name for law in draw.laws] == ["neo-hookean", "ogden", "ogden"]
    np.testing.assert_array_equal(draw.curves[0], draw.curves[2])
    assert draw.laws[1] != draw.laws[2]
    # the third tissue adds nothing to what is drawn
    assert draw_laws(trained(), [GREY, WHITE], ["neo-hookean", "ogden"], 0).laws == draw.laws[:2]


def test_an_unstable_draw_is_redrawn_and_reported():
    draws = [draw_laws(trained(), [BRAIN], "ogden", number) for number in range(60)]
    redrawn = [draw for draw in draws if draw.rejected]
    assert 0.01 < rejection_rate(draws) < 0.2
    assert sum(len(draw.rejected) for draw in draws) / (
        60 + sum(len(draw.rejected) for draw in draws)
    ) == pytest.approx(rejection_rate(draws))
    for draw in redrawn:
        assert all(reason.startswith(f"{BRAIN}: Ogden(") for reason in draw.rejected)
        # what stands is the attempt after the rejected ones
        attempt = trained().draw([BRAIN], draw.stretches[0], (draw.number, len(draw.rejected)))
        np.testing.assert_allclose(attempt[0], draw.curves[0], rtol=1e-12)
    for draw in draws:
        assert not any(unstable(fitted) for fitted in draw.fits)


def test_stability_is_that_of_the_formulation():
    """Coupled Mooney-Rivlin of a compressible tissue: much C2 makes its volumetric modulus negative."""
    coupled, uncoupled = (
        [draw_laws(trained(), [BRAIN], "mooney-rivlin", k, poisson=0.3, formulation=formulation) for k in range(20)]
        for formulation in ("coupled", "uncoupled")
    )
    assert rejection_rate(coupled) > 0.3 and rejection_rate(uncoupled) == 0.0


def test_a_law_that_is_never_stable_ends(monkeypatch):
    count = itertools.count()
    monkeypatch.setattr(sampling, "unstable", lambda *_: f"reason {next(count)}")
    with pytest.raises(SolveError, match=r"draw 3 of seed 0: all of 200 attempts are unstable .* reason 199"):
        draw_laws(trained(), [BRAIN], "neo-hookean", 3)


def test_the_middle_law_is_the_default_models():
    assert middle_law(GREY, "ogden") == law_of_curve(trained(), GREY, law="ogden").law()


@pytest.mark.parametrize(
    ("groups", "law", "number", "seed", "message"),
    [
        (
            ["MRE/abnormal"],
            "ogden",
            0,
            0,
            r"group 'MRE/abnormal': .* \(corrected\) has seen no study of it; it has MRE/grey",
        ),
        (["grey"], "ogden", 0, 0, "group 'grey'"),
        ([GREY], "fung", 0, 0, "law 'fung': expected one of neo-hookean, mooney-rivlin, ogden"),
        ([GREY], "ogden", -1, 0, "number -1: expected a whole number of at least 0"),
        ([GREY], "ogden", 0, -2, "seed -2"),
    ],
)
def test_what_is_wrong_is_named(groups, law, number, seed, message):
    with pytest.raises(InputError, match=message):
        draw_laws(trained(), groups, law, number, seed)
