"""Tension against compression: what papers publish, what the model learns of it, and what its draws do."""

import numpy as np
import pytest
from scipy.stats import beta

from warpbrain.gp.asymmetry import (
    REACH,
    STRAINS,
    asymmetries_of_papers,
    asymmetry,
    asymmetry_of,
)
from warpbrain.gp.hierarchy import (
    CENTRE,
    EFFECTS,
    MEAN_ASYMMETRY,
    REST,
    Conditional,
    Hierarchical,
    Hierarchy,
    Observations,
    Places,
    Structure,
    fit_hierarchy,
    mean_asymmetry_of,
    observations,
    prior,
    sample_hierarchies,
)
from warpbrain.gp.literature.forms import FORMS
from warpbrain.gp.literature.studies import read_studies
from warpbrain.gp.literature.study import GROUPS, OFFSET, STRETCHES, Study, equivalent_strain, invariant, stretch_of
from warpbrain.gp.trained import trained

HYPERELASTIC = [f"hyperelastic/{anatomy}" for anatomy in ("grey matter", "white matter", "brain")]


def ogden(alpha, mu0=1000.0):
    values = {"mu": (2.0 * mu0 / alpha,), "alpha": (alpha,)}
    return Study(f"a-{alpha}", "hyperelastic/brain", "ogden", values, values, (0.7, 1.3))


def test_strains_of_one_size_have_one_invariant():
    sizes = np.geomspace(1e-8, 3.0, 40)
    strains = np.concatenate([-sizes[::-1], [0.0], sizes])
    stretches = stretch_of(strains)
    # a stretch has 16 digits beside 1
    np.testing.assert_allclose(equivalent_strain(stretches), strains, rtol=1e-12, atol=1e-15)
    away = sizes[sizes > 1e-4]
    np.testing.assert_allclose(invariant(stretch_of(-away)), invariant(stretch_of(away)), rtol=1e-11)
    assert np.all(np.diff(stretches) > 0.0) and stretches[40] == 1.0
    np.testing.assert_allclose(stretches[55] - 1.0, strains[55], rtol=1e-4)


def test_forms_of_the_first_invariant_are_symmetric_and_no_others():
    """At random parameters of every form; a study that fitted both sides apart is asymmetric in any form."""
    known = {name: form for name, form in FORMS.items() if not name.startswith("linear")}
    random = np.random.default_rng(3)
    for name, form in known.items():
        keys = next(iter(form.conventions.values())).keys.values()
        values = {key.name: float(random.uniform(0.1, 0.3)) for key in keys}
        values |= {key.name: (100.0, 30.0) if key.name == "mu" else (-3.0, 5.0) for key in keys if key.several}
        energies = form.energy(stretch_of(np.array([-0.2, 0.2])), **values)
        assert form.of_first_invariant == (abs(np.log(energies[1] / energies[0])) < 1e-9), name
    apart = Study("a", HYPERELASTIC[0], "neo-hookean", {"mu": 3.0}, {"mu": 1.0}, (0.9, 1.1))
    assert not apart.symmetric and asymmetry_of(apart) == pytest.approx(-np.log(3.0))


def test_asymmetry_of_a_published_energy():
    """Of an Ogden energy to first order in strain: (alpha - 2) / 3 times the strain, in the mean over strains."""
    small = ogden(-8.0)
    small = Study(small.name, small.group, small.form, small.compression, small.tension, (0.999, 1.001))
    assert asymmetry_of(small) == pytest.approx(-10.0 / 3.0 * 1e-3 * STRAINS.mean(), rel=2e-3)
    assert asymmetry_of(ogden(-5.0)) < asymmetry_of(ogden(-2.0)) < asymmetry_of(ogden(2.0)) == 0.0
    assert asymmetry_of(ogden(4.0)) > 0.0


def test_what_papers_say():
    """Five are stiffer in compression, two could not say it, none is stiffer in tension."""
    papers = asymmetries_of_papers(read_studies("corrected"))
    able = {name: value for name, (value, free) in papers.items() if free}
    assert len(papers) == 7 and len(able) == 5
    assert all(-0.9 < value < -0.3 for value in able.values())
    assert {name for name in papers if name not in able} == {"Kyriacou1999", "Schiavone2009"}
    # as trained on by the paper, the mistaken formula of study 50 is the other way round
    published = asymmetries_of_papers(read_studies("as_published"))
    assert [name for name, (value, _) in published.items() if value > 0.0] == ["Laksari2012"]


@pytest.mark.parametrize("group", HYPERELASTIC)
def test_draws_respect_what_papers_show(group):
    """No paper of five that could is stiffer in tension: 95 % interval of the part of papers that are 0 to 52 %."""
    found = asymmetry(trained(), group)
    low, high = equivalent_strain(STRETCHES[group])
    stretches = stretch_of(np.multiply.outer([-1.0, 1.0], STRAINS * min(-low, high)).ravel())
    energies = np.exp([trained().draw([group], stretches, number)[0] for number in range(600)]) - OFFSET
    compression, tension = np.split(np.log(energies / invariant(stretches)), 2, axis=1)
    drawn = np.mean(tension - compression, axis=1)
    share = float(np.mean(drawn > 0.0))
    error = np.sqrt(found.tension * (1.0 - found.tension) / len(drawn))
    assert abs(share - found.tension) < 3.5 * error
    # not excluded, and yet far from even: of five papers none would be with a probability of at least a sixth
    assert 0.02 < found.tension < 0.3 and (1.0 - found.tension) ** 5 > 1.0 / 6.0
    assert beta.ppf(0.975, 1, 5) > found.tension
    low, high = np.quantile(drawn, [0.025, 0.975])
    # Monte Carlo error of the outermost quantiles of 600 draws: at most 0.18 off
    assert (low, high) == pytest.approx((found.new_low, found.new_high), abs=0.25)
    # what every paper published is within
    papers = asymmetries_of_papers(read_studies("corrected"))
    assert all(found.new_low < value < found.new_high for value, _ in papers.values())


def test_the_mean_is_learnt():
    """Compression is stiffer in the mean of papers, and a model without a mean says so of nothing."""
    found = asymmetry(trained(), "hyperelastic/brain")
    assert found.low < found.mean < found.high < 0.0
    studies = read_studies("corrected")
    hierarchy, _ = fit_hierarchy(observations(studies), first=trained().hierarchy, mean_asymmetry=(0.0, 0.0))
    without = asymmetry(Hierarchical(studies, hierarchy), "hyperelastic/brain")
    assert without.mean == without.low == without.high == 0.0 and without.tension == pytest.approx(0.5)


def test_symmetric_forms_say_nothing_of_asymmetry():
    """Twenty neo-Hookean studies more: moduli are known better, the mean asymmetry is not.

    Not to the last digit: stretches of studies are not of equal strain on both sides, so even curves matter a little.
    """
    model = trained()
    more = [
        Study(f"a-Author{1900 + n}", "hyperelastic/brain", "neo-hookean", {"mu": 500.0}, {"mu": 500.0}, (0.7, 1.3))
        for n in range(20)
    ]
    before, after = (
        Hierarchical(studies, model.hierarchy).conditionals[0].mean_asymmetry()
        for studies in (model.studies, (*model.studies, *more))
    )
    for moment_before, moment_after in zip(before, after, strict=True):
        np.testing.assert_allclose(moment_after, moment_before, atol=0.02)


def test_mean_asymmetry_against_a_regression():
    """Without curves the mean asymmetry is that of a linear regression, by generalised least squares."""
    random = np.random.default_rng(5)
    places = _places(6, 2, np.array([-0.3, -0.1, 0.1, 0.3]))
    none = dict.fromkeys(EFFECTS, 1e-6)
    hierarchy = Hierarchy(none | {"asymmetry at rest, paper": 0.2}, 0.3, mean_asymmetry=(1e3, 1e3))
    modulus = CENTRE + mean_asymmetry_of(places) @ [-0.7, 0.1] + 0.05 * random.standard_normal(len(places.task))
    mean, covariance = Conditional(hierarchy, Observations(places, modulus)).mean_asymmetry()
    x = np.column_stack([mean_asymmetry_of(places), np.ones(len(modulus))])
    sides = np.sign(equivalent_strain(places.stretch))
    V = REST**2 * np.eye(len(modulus)) + 0.04 * np.outer(sides, sides) * (places.source[:, None] == places.source)
    inverse = np.linalg.inv(x.T @ np.linalg.solve(V, x))
    np.testing.assert_allclose(mean, (inverse @ x.T @ np.linalg.solve(V, modulus))[:2], atol=2e-3)
    np.testing.assert_allclose(covariance, inverse[:2, :2], rtol=1e-4, atol=1e-7)


@pytest.mark.slow
def test_intervals_of_the_mean_asymmetry_hold_the_truth(verify):
    """Simulation-based calibration: truths from the prior, seven papers of three studies each, as in the literature."""
    random = np.random.default_rng(11)
    places = _places(7, 3, np.array([-0.3, -0.1, 0.1, 0.3]))
    basis, weights = mean_asymmetry_of(places), np.array([np.tanh(0.3 / REACH), 1.0])
    centre, spread = prior()
    ranks = []
    for _ in range(120):
        truth = Hierarchy.from_vector(centre + spread * random.standard_normal(len(centre)))
        flat = Hierarchy(truth.spread, truth.length_scale, mean_asymmetry=(0.0, 0.0))
        covariance = flat.covariance(Structure.of(places, places)) + REST**2 * np.eye(len(basis))
        both = np.array(MEAN_ASYMMETRY) * random.standard_normal(2)
        modulus = CENTRE + basis @ both + np.linalg.cholesky(covariance) @ random.standard_normal(len(basis))
        seen = Observations(places, modulus)
        best, _ = fit_hierarchy(seen)
        moments = [Conditional(one, seen).mean_asymmetry() for one in sample_hierarchies(best, seen, 24)]
        means = np.array([weights @ mean for mean, _ in moments])
        spreads = np.sqrt([weights @ c @ weights for _, c in moments])
        normal = random.standard_normal((len(means), 400))
        ranks.append(np.mean(means[:, None] + spreads[:, None] * normal < weights @ both))
    ranks = np.array(ranks)
    for part in (0.5, 0.9):
        held = np.mean(np.abs(ranks - 0.5) < 0.5 * part)
        band = 2.58 * np.sqrt(part * (1.0 - part) / len(ranks))
        verify(
            f"{100 * part:g} % posterior intervals of the mean asymmetry hold that part of truths",
            "simulation-based calibration, 120 hierarchies drawn from the prior; bound: 99 % binomial band",
            abs(held - part),
            band,
        )


def _places(papers, studies, strains):
    source, study, strain = (
        part.ravel() for part in np.meshgrid(np.arange(papers), np.arange(studies), strains, indexing="ij")
    )
    task = np.full(len(strain), GROUPS.index("hyperelastic/brain"))
    return Places(source * studies + study, source, task, stretch_of(strain), np.zeros(len(strain), dtype=bool))
