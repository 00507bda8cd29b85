"""Probabilities of sets against the densities of joint normal distributions written out, and against their draws."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from drawn_rows import draws
from scipy import stats
from scipy.special import logsumexp, softmax

from warpbrain.inference.causes import Cause, Place
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.subsets import Search, likely_places, posterior

N = 30
SCALES = Search(np.array([0.8, 1.25]), np.log([0.4, 0.6]), negligible=1e-12, beam=10_000)


def model(random: np.random.Generator) -> GaussianModel:
    return GaussianModel(np.diag(random.uniform(0.5, 1.5, N)), random.normal(size=(N, 3)))


def some_causes(random: np.random.Generator) -> list[Cause]:
    """Causes of one to five columns, of one to four places, one with a mean."""

    def places(count: int, width: int, mean: bool = False) -> tuple[Place, ...]:
        each = range(count)
        return tuple(Place(random.normal(size=(N, width)), random.normal(size=N) if mean else None) for _ in each)

    sizes = np.array([0.3, 1.0, 3.0])
    return [
        Cause("patch", places(4, 3), -2.0, sizes),
        Cause("level", places(3, 1, mean=True), -2.5, sizes / 3.0),
        Cause("field", places(2, 5), -3.0, sizes, shares=np.array([0.9, 0.1])),
        Cause("switch", places(2, 1), -3.5, sizes),
    ]


def by_hand(one: GaussianModel, residual: np.ndarray, causes: list[Cause], members: tuple[int, ...]) -> float:
    """Log density of the rows with these causes, every sum written out."""
    logs = []
    for scale, log_scale in zip(SCALES.scales, SCALES.log_scale_prior, strict=True):
        base = one.with_scale(scale).covariance
        choices = [[]]
        for c in members:
            cause = causes[c]
            shares = [1.0 / len(cause.places)] * len(cause.places) if cause.shares is None else cause.shares
            choices = [
                [*chosen, (place, size, np.log(share / len(cause.sizes)))]
                for chosen in choices
                for place, share in zip(cause.places, shares, strict=True)
                for size in cause.sizes
            ]
        for chosen in choices:
            covariance, mean = base.copy(), np.zeros(N)
            for place, size, _ in chosen:
                covariance += size**2 * place.columns @ place.columns.T
                mean += 0.0 if place.mean is None else place.mean
            density = stats.multivariate_normal(mean, covariance).logpdf(residual)
            logs.append(density + log_scale + sum(log for *_, log in chosen))
    return float(logsumexp(logs))


def test_evidence_is_the_sum_of_the_densities_written_out() -> None:
    random = np.random.default_rng(0)
    one, causes = model(random), some_causes(random)
    residual = draws(one, 1, random)[:, 0] + 2.0 * causes[0].places[1].columns @ [1.0, 0.3, -0.5]
    found = {hypothesis.causes: hypothesis for hypothesis in posterior(one, residual, causes, SCALES)}
    for count in range(3):
        for members in combinations(range(4), count):
            expected = by_hand(one, residual, causes, members)
            names = tuple(causes[c].name for c in members)
            assert found[names].log_evidence == pytest.approx(expected, abs=1e-9), names
            assert found[names].log_prior == pytest.approx(sum(causes[c].log_prior for c in members))
    for members in combinations(range(4), 3):
        # with a beam that leaves nothing out the sum over the best configurations of pairs is a lower bound
        expected = by_hand(one, residual, causes, members)
        assert expected - 1.5 < found[tuple(causes[c].name for c in members)].log_evidence < expected + 1e-9


def test_a_place_has_its_share_of_the_evidence() -> None:
    random = np.random.default_rng(6)
    one, causes = model(random), some_causes(random)
    residual = draws(one, 1, random)[:, 0] + 0.5 * causes[0].places[2].columns @ [1.0, -0.4, 0.2]
    for hypothesis in posterior(one, residual, causes, SCALES):
        if len(hypothesis.causes) != 1:
            assert hypothesis.best.log_share == 0.0
            continue
        [cause] = [cause for cause in causes if cause.name == hypothesis.causes[0]]
        number = hypothesis.best.members[0].place
        alone = by_hand(one, residual, [replace(cause, places=(cause.places[number],), shares=None)], (0,))
        prior = 1.0 / len(cause.places) if cause.shares is None else cause.shares[number]
        share = alone + np.log(prior) - hypothesis.log_evidence
        np.testing.assert_allclose(hypothesis.best.log_share, share, atol=1e-8)


def test_best_configuration_has_the_greatest_density() -> None:
    random = np.random.default_rng(1)
    one, causes = model(random), some_causes(random)
    residual = draws(one, 1, random)[:, 0] + 4.0 * causes[0].places[2].columns @ [1.0, 1.0, -0.5]
    best = posterior(one, residual, causes, SCALES)[0]
    assert "patch" in best.causes
    assert next(member.place for member in best.best.members if member.cause == 0) == 2


def test_probabilities_are_calibrated_over_draws_of_the_model(verify) -> None:
    """Of sets that are drawn with their prior, those that are given the probability p are right in a share p."""
    random = np.random.default_rng(2)
    one, causes = model(random), some_causes(random)[:3]
    sets = [(), (0,), (1,), (2,), (0, 1), (0, 2), (1, 2)]
    log_prior = np.array([sum(causes[c].log_prior for c in members) for members in sets])
    prior = np.exp(log_prior - logsumexp(log_prior))
    scores, variance = 0.0, 0.0
    search = Search(np.ones(1), np.zeros(1), beam=0)
    for _ in range(150):
        members = sets[random.choice(len(sets), p=prior)]
        rows = draws(one, 1, random)[:, 0]
        for c in members:
            place = causes[c].places[random.choice(len(causes[c].places))]
            size = random.choice(causes[c].sizes)
            rows += size * place.columns @ random.normal(size=place.columns.shape[1])
            rows += 0.0 if place.mean is None else place.mean
        found = posterior(one, rows, causes, search)
        for p, names in zip(
            softmax([h.log_evidence + h.log_prior for h in found]), (h.causes for h in found), strict=True
        ):
            if names == ("patch",) or names == ("patch", "level"):
                scores += float(tuple(causes[c].name for c in members) == names) - p
                variance += p * (1.0 - p)
    verify(
        "probabilities of sets of causes, over draws of the model: sum of (right - p)",
        "its standard deviation if they are calibrated",
        abs(scores) / np.sqrt(variance),
        3.0,
        "standard deviations",
    )


def test_likely_places_are_those_of_the_greatest_density():
    random = np.random.default_rng(11)
    one, causes, residual = model(random), some_causes(random), 2.0 * random.normal(size=N)
    found = likely_places(one, residual, causes, 2)
    for cause in causes:
        density = [
            logsumexp(
                [
                    one.with_columns(size * place.columns).log_density(
                        residual - (0.0 if place.mean is None else place.mean)
                    )
                    for size in cause.sizes
                ]
            )
            - np.log(len(cause.places))
            for place in cause.places
        ]
        assert set(found[cause.name].tolist()) == set(np.argsort(density)[-2:].tolist())


def test_a_single_cause_keeps_the_best_place_of_each_label():
    random = np.random.default_rng(4)
    given, [cause, *others] = model(random), some_causes(random)
    labels = ["a" if number < len(cause.places) - 2 else "b" for number in range(len(cause.places))]
    cause = replace(cause, places=tuple(map(lambda p, label: replace(p, label=label), cause.places, labels)))
    residual = draws(given, 1, random)[:, 0] + 3.0 * cause.places[0].columns @ random.normal(size=3)
    found = posterior(given, residual, [cause, *others], SCALES)
    single = next(hypothesis for hypothesis in found if hypothesis.causes == (cause.name,))
    assert labels[single.best.members[0].place] == "a"
    [other] = single.elsewhere
    of_places = [
        next(h for h in posterior(given, residual, [replace(cause, places=(place,))], SCALES) if h.causes)
        for place in cause.places[-2:]
    ]
    best = len(labels) - 2 + int(np.argmax([h.best.log_density for h in of_places]))
    assert other.members[0].place == best


def test_a_single_cause_keeps_its_next_best_places():
    random = np.random.default_rng(3)
    given, causes = model(random), some_causes(random)
    residual = draws(given, 1, random)[:, 0] + causes[0].places[2].columns @ random.normal(size=3)
    found = posterior(given, residual, causes, Search(SCALES.scales, SCALES.log_scale_prior, elsewhere=2))
    for hypothesis in found:
        if len(hypothesis.causes) != 1:
            assert hypothesis.elsewhere == ()
            continue
        [cause] = [c for c in causes if (c.name,) == hypothesis.causes]
        tried = [hypothesis.best, *hypothesis.elsewhere]
        assert len(tried) == min(3, len(cause.places))
        assert len({configuration.members[0].place for configuration in tried}) == len(tried)
        logs = [configuration.log_density for configuration in tried]
        assert logs == sorted(logs, reverse=True)
        # each is the best of its place
        for configuration in tried:
            [member] = configuration.members
            only = Cause(cause.name, (cause.places[member.place],), cause.log_prior, cause.sizes)
            alone = posterior(given, residual, [only], SCALES)
            best = next(h.best for h in alone if h.causes)
            count = len(cause.places)
            weight = np.log(1.0 / count if cause.shares is None else cause.shares[member.place])
            assert configuration.log_density == pytest.approx(best.log_density + weight)
