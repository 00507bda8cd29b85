"""Numbers of mechanisms that are not expected at all are no explanation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.mechanisms.traction import Traction
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.parameters import log_within_expected, numbers_of


def _compressibility() -> Effect:
    return Effect(mechanisms()["compressibility"].about_law(0.45, 0.4), np.zeros(3), np.ones((3, 1)))


@pytest.mark.parametrize(("z", "sd"), [(0.0, 0.1), (-0.5, 0.2), (-3.0, 0.3), (-3.0, 0.8)])
def test_it_is_the_part_of_the_posterior_within_the_range(z, sd):
    """As of draws of the number itself, to first order."""
    effect = _compressibility()
    spec = mechanisms()["compressibility"].parameters()["poisson"]
    low, high = spec.expectation.ends
    at = np.array([z])
    middle = numbers_of(effect, at)["poisson"][0]
    slope = (numbers_of(effect, at + 0.01 * sd)["poisson"][0] - numbers_of(effect, at - 0.01 * sd)["poisson"][0]) / 0.02
    draws = middle + slope * np.random.default_rng(0).normal(size=200_000)
    part = np.mean((draws > low) & (draws < high))
    assert np.exp(log_within_expected(effect, at, np.array([[sd**2]]))) == pytest.approx(part, abs=0.02)


def test_a_poisson_ratio_of_a_tenth_is_none():
    z = np.array([(-np.log(0.8) + np.log(0.1)) / 0.4])
    assert log_within_expected(_compressibility(), z, np.array([[0.01]])) < -20.0


def test_what_has_no_range_is_as_probable_as_it_was(small_diagnosis):
    [weight, *_] = small_diagnosis.search.candidates.effects["gravity"]
    k = len(weight.proposed.mean)
    assert log_within_expected(weight, np.full(k, 5.0), np.eye(k)) == 0.0


@pytest.mark.parametrize(("seen", "noise"), [(1.5, 0.5), (0.2, 0.5), (-0.4, 0.5)])
def test_of_what_is_never_negative_half_of_a_normal_prior_cannot_be(seen, noise):
    """The evidence of a half-normal prior over that of a normal one, by quadrature, of one number that was seen."""

    def density(c: float) -> float:
        return float(norm.pdf(seen, c, noise) * norm.pdf(c))

    precision = 1.0 + noise**-2
    relaxing = Viscoelasticity(moduli=(1.0,), times=(1.0,))
    proposal = Proposal.of_one(lambda c: replace(relaxing, moduli=(max(c, 1e-6),)), 0.0, 1.0, positive=(0,))
    effect = Effect(proposal, np.zeros(3), np.ones((3, 1)))
    half, whole = 2.0 * quad(density, 0.0, 9.0)[0], quad(density, -9.0, 9.0)[0]
    z = np.array([seen / noise**2 / precision])
    assert log_within_expected(effect, z, np.array([[1.0 / precision]])) == pytest.approx(
        np.log(half / whole), abs=1e-3
    )


@pytest.mark.parametrize(
    ("radius", "expected"), [(0.009, 0.0), (0.017, 0.0), (0.014 * 1.25**3, -2.0), (0.009 / 1.25**2, -0.5)]
)
def test_a_radius_far_from_those_that_are_looked_for_is_improbable(radius, expected):
    proposal = Proposal.of_one(
        lambda c: Traction(centre=(0.0, 0.0, 0.0), value=(c, 0.0, 0.0), radius=radius),
        0.0,
        1.0,
        radius=radius,
        radii=(0.009, 0.014),
    )
    effect = Effect(proposal, np.zeros(3), np.ones((3, 1)))
    assert log_within_expected(effect, np.zeros(1), np.eye(1)) == pytest.approx(expected)
