"""The prior of law parameters: samples, densities, and what is said of the Gaussian approximation."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from warpbrain.errors import InputError
from warpbrain.gp.prior import Prior, coordinates, from_coordinates, to_coordinates
from warpbrain.gp.sampling import draw_laws
from warpbrain.gp.trained import trained
from warpbrain.physics.laws import LAWS, MooneyRivlin, NeoHookean, Ogden

GREY, WHITE, BRAIN = (f"hyperelastic/{anatomy}" for anatomy in ("grey matter", "white matter", "brain"))


@pytest.fixture(scope="module")
def neo_hookean():
    return Prior.of(trained(), [GREY, WHITE], "neo-hookean", count=500)


@pytest.fixture(scope="module")
def ogden():
    return Prior.of(trained(), [BRAIN], "ogden", count=200)


@pytest.fixture(scope="module")
def mooney_rivlin():
    return Prior.of(trained(), [BRAIN], "mooney-rivlin", count=200)


@pytest.mark.parametrize("law", [NeoHookean(700.0), MooneyRivlin(100.0, 250.0), Ogden((-300.0,), (-6.0,))])
def test_coordinates_are_those_of_the_law(law):
    values = to_coordinates(law)
    assert len(values) == len(coordinates(law.name)) and np.exp(values[0]) == pytest.approx(law.shear_modulus)
    again = from_coordinates(law.name, values)
    assert type(again) is type(law)
    assert again.parameters() == pytest.approx(law.parameters(), rel=1e-12)


def test_what_has_no_coordinates_is_refused():
    with pytest.raises(InputError, match="Ogden with one term"):
        to_coordinates(Ogden((1.0, 1.0), (2.0, 3.0)))
    with pytest.raises(InputError, match=r"ogden: found 1 numbers, expected 2: ln\(mu0 / Pa\), alpha"):
        from_coordinates("ogden", [1.0])
    with pytest.raises(InputError, match="law 'fung': expected one of neo-hookean"):
        coordinates("fung")


@pytest.mark.slow(8)
def test_samples_are_the_draws(neo_hookean):
    assert neo_hookean.names == (f"{GREY}: ln(mu0 / Pa)", f"{WHITE}: ln(mu0 / Pa)")
    samples = neo_hookean.samples(5)
    for number, theta in enumerate(samples):
        draw = draw_laws(trained(), [GREY, WHITE], "neo-hookean", number)
        np.testing.assert_allclose(np.exp(theta), draw.shear_moduli, rtol=1e-12)
        assert [law.shear_modulus for law in neo_hookean.laws(theta)] == pytest.approx(draw.shear_moduli)
    np.testing.assert_array_equal(neo_hookean.samples(505)[:500], neo_hookean.theta)
    other = neo_hookean.samples(3, seed=1)
    assert other.shape == (3, 2) and not np.any(other == samples[:3])
    # what a caller does to its samples is its own affair
    samples[:] = 0.0
    assert neo_hookean.theta.all()


def gaussian(prior):
    return multivariate_normal(prior.mean, prior.covariance)


def test_of_a_neo_hookean_law_it_is_nearly_gaussian(neo_hookean):
    assert neo_hookean.rejection_rate == 0.0 and not neo_hookean.at_bound.any()
    assert neo_hookean.distances.max() < 0.05
    # both densities say nearly the same of samples that neither has seen: the tails are those of several hierarchies
    fresh = neo_hookean.samples(200, seed=1)
    away = neo_hookean.log_density(fresh) - gaussian(neo_hookean).logpdf(fresh)
    assert abs(away.mean()) < 0.1


def test_densities_of_one_point_are_numbers(neo_hookean):
    one = neo_hookean.log_density(neo_hookean.mean)
    assert isinstance(one, float) and one == pytest.approx(neo_hookean.log_density(neo_hookean.mean[None])[0])


@pytest.mark.slow(6)
def test_an_exponent_of_either_sign(ogden):
    """Two clusters with nothing between them, which a Gaussian would fill."""
    alpha = ogden.theta[:, 1]
    assert 0.2 < (alpha < 0.0).mean() < 0.9
    assert not ((alpha > -2.0) & (alpha < 1.0)).any()
    assert 0.0 < ogden.rejection_rate < 0.2
    assert ogden.distances[1] > 3.0 * ogden.distances[0]
    fresh = ogden.samples(100, seed=1)
    assert np.mean(ogden.log_density(fresh)) > np.mean(gaussian(ogden).logpdf(fresh)) + 0.2
    assert isinstance(ogden.laws(fresh[0])[0], Ogden)


@pytest.mark.slow(2)
def test_a_ratio_that_piles_up_at_its_ends(mooney_rivlin):
    assert mooney_rivlin.names[1].endswith("C2 / (C1 + C2)")
    ratio = mooney_rivlin.theta[:, 1]
    assert mooney_rivlin.at_bound[0] > 0.5
    assert ((ratio < 0.01) | (ratio > 0.99)).mean() == pytest.approx(mooney_rivlin.at_bound[0], abs=0.01)
    assert mooney_rivlin.distances[1] > 0.2
    fresh = mooney_rivlin.samples(100, seed=1)
    assert np.mean(mooney_rivlin.log_density(fresh)) > np.mean(gaussian(mooney_rivlin).logpdf(fresh)) + 0.2
    beyond = np.array([mooney_rivlin.mean[0], 1.001])
    assert mooney_rivlin.log_density(beyond) == -np.inf


def test_every_tissue_has_its_own_law():
    prior = Prior.of(trained(), [GREY, WHITE], ["neo-hookean", "ogden"], count=40)
    assert len(prior.names) == 3 and prior.theta.shape == (40, 3) and prior.at_bound.shape == (2,)
    assert [law.name for law in prior.laws(prior.mean)] == ["neo-hookean", "ogden"]
    assert set(LAWS) >= set(prior.laws_of)


@pytest.mark.parametrize(
    ("groups", "law", "count", "message"),
    [
        ([GREY, GREY], "ogden", 100, "one is given twice"),
        ([GREY], "ogden", 19, "count 19: expected at least 20 draws for 2 parameters"),
        (["MRE/abnormal"], "ogden", 20, "'MRE/abnormal'"),
        ([GREY], "fung", 100, "law 'fung'"),
    ],
)
def test_what_is_wrong_is_named(groups, law, count, message):
    with pytest.raises(InputError, match=message):
        Prior.of(trained(), groups, law, count=count)


def test_a_vector_of_another_length_is_refused(neo_hookean):
    with pytest.raises(InputError, match=r"theta of shape \(3,\): expected 2"):
        neo_hookean.log_density(np.zeros(3))
    with pytest.raises(InputError, match="theta of shape"):
        neo_hookean.laws(np.zeros(1))
