"""Evidence of a fit under priors that overlap, against that of Gaussian data in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.parameters import log_overlap

SIZES = (0.3, 1.0, 2.5)


def _about(how: float) -> Proposal:
    """How much and, about some value, how."""
    return Proposal(_swelling, np.array([0.0, how]), np.array([0.5, 0.6]), "smooth", unscaled=(1,))


def _swelling(c: np.ndarray) -> Swelling:
    return Swelling(amount=float(c[0]))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("noise", [0.05, 0.7])
def test_it_is_the_sum_over_all_places_and_sizes(size: float, noise: float) -> None:
    places = [_about(how) for how in (-1.0, 0.0, 1.0)]
    seen, of_seen = np.array([0.4, 0.3]), noise**2 * np.array([[1.0, 0.4], [0.4, 2.0]])
    effect = replace(Effect(places[1], np.zeros(3), np.ones((3, 2))).scaled(size), sizes=SIZES)
    prior = np.diag(effect.proposed.sd**2)
    posterior = np.linalg.inv(np.linalg.inv(of_seen) + np.linalg.inv(prior))
    mean = posterior @ (np.linalg.solve(of_seen, seen) + np.linalg.solve(prior, effect.proposed.mean))

    def evidence(proposal: Proposal) -> float:
        variances = [np.diag((np.array([each, 1.0]) * proposal.sd) ** 2) for each in SIZES]
        return sum(multivariate_normal.pdf(seen, proposal.mean, of_seen + variance) for variance in variances)

    sd = effect.proposed.sd
    overlap = log_overlap(effect, (mean - effect.proposed.mean) / sd, posterior / np.outer(sd, sd), places)
    assert overlap == pytest.approx(np.log(sum(map(evidence, places)) / evidence(places[1])), abs=1e-6)
