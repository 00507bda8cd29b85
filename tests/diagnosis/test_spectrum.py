"""How much relaxes in all, against a sample of all hypotheses with the whole likelihood of the sensors."""

from types import SimpleNamespace

import numpy as np
import pytest

from warpbrain.diagnosis.spectrum import amount_in_all
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.effects import Effect

TIMES, POINTS, NOISE, SAMPLES = (1.5, 7.5, 37.5), 12, 0.02, 60000
#: Moduli and times of what relaxes, in two times, far apart, or in one.
TRUTHS = {"two": ((0.15, 0.15), (4.0, 40.0)), "one": ((0.3,), (8.0,))}


@pytest.fixture(scope="module")
def proposals() -> list[Proposal]:
    situation = SimpleNamespace(instants=len(TIMES), require_new=lambda _kind: None)
    return list(Viscoelasticity.proposals(situation))


def _seen(c: np.ndarray) -> np.ndarray:
    """How much less there is at each time (s, 3), of coefficients (s, k)."""
    if c.shape[1] == 2:
        shares, times = np.ones((len(c), 1)), np.exp(c[:, 1:])
    else:
        first = 1.0 / (1.0 + np.exp(-c[:, 3]))
        shares, times = np.column_stack([first, 1.0 - first]), np.exp(c[:, 1:3])
    parts = np.column_stack([(shares * np.exp(-t / times)).sum(axis=1) for t in TIMES])
    whole = c[:, :1] * parts
    return whole / (1.0 + whole), parts[:, 0] - parts[:, -1]


def _sampled(proposals, residual, D, covariance) -> tuple[float, float]:
    """Mean and standard deviation of the logarithm of the amount."""
    rng = np.random.default_rng(5)
    precision = np.linalg.inv(covariance)
    logs, amounts = [], []
    for proposal in proposals:
        c = proposal.mean + proposal.sd * rng.normal(size=(SAMPLES, len(proposal)))
        c[:, 0] = np.abs(c[:, 0])
        seen, relaxed = _seen(c)
        left = residual - seen @ D.T
        log = -0.5 * np.einsum("si,ij,sj->s", left, precision, left, optimize=True)
        logs.append(log[relaxed >= 0.25])
        amounts.append(np.log(c[relaxed >= 0.25, 0]))
    log, amount = np.concatenate(logs), np.concatenate(amounts)
    weights = np.exp(log - log.max())
    weights /= weights.sum()
    assert 1.0 / (weights**2).sum() > 200.0
    mean = float(weights @ amount)
    return mean, float(np.sqrt(weights @ (amount - mean) ** 2))


@pytest.fixture(scope="module", params=list(TRUTHS))
def recorded(request: pytest.FixtureRequest):
    """What was recorded, what is there at once by time, nuisances, and how much relaxes."""
    rng = np.random.default_rng(11)
    moduli, times = TRUTHS[request.param]
    at_once = rng.normal(size=POINTS)
    D = np.kron(np.eye(len(TIMES)), at_once[:, None])
    left = np.array([sum(m * np.exp(-t / tau) for m, tau in zip(moduli, times, strict=True)) for t in TIMES])
    # a nuisance that is the same at all times, as tissue is, and others
    nuisances = np.column_stack([0.1 * np.tile(at_once, 3), 0.05 * rng.normal(size=(len(D), 3))])
    noise = NOISE * rng.normal(size=len(D)) + nuisances @ (0.5 * rng.normal(size=4))
    return D @ (left / (1.0 + left)) + noise, D, nuisances, sum(moduli)


def _fit(proposal: Proposal, recorded, z: np.ndarray) -> SimpleNamespace:
    residual, D, nuisances, _ = recorded
    here = proposal.mean + proposal.sd * z
    axes = 1e-5 * np.diag(proposal.sd)
    slopes = [D @ (_seen((here + axis)[None])[0][0] - _seen((here - axis)[None])[0][0]) / 2e-5 for axis in axes]
    columns = np.column_stack(slopes)
    sensors = SimpleNamespace(times=np.repeat(TIMES, POINTS), is_displacement=np.ones(len(D), dtype=bool))
    return SimpleNamespace(
        effects=(Effect(proposal, D @ _seen(here[None])[0][0], columns, lasting=D.sum(axis=1, keepdims=True)),),
        state=SimpleNamespace(sensors=sensors),
        coefficients=(z,),
        covariances=(np.eye(len(z)),),
        nuisances=np.zeros(nuisances.shape[1]),
        columns=np.column_stack([nuisances, columns]),
        linear=residual - D @ _seen(here[None])[0][0] + columns @ z,
        kappa=1.0,
    )


def test_it_is_the_mean_over_all_hypotheses(proposals, recorded):
    residual, D, nuisances, true = recorded
    mean, sd = _sampled(proposals, residual, D, NOISE**2 * np.eye(len(D)) + nuisances @ nuisances.T)
    effects = [Effect(one, np.zeros(1), np.zeros((1, len(one)))) for one in proposals]
    factor = NOISE * np.eye(len(D))
    # about a fit of one time and about one of two
    for size in (2, 4):
        proposal = next(one for one in proposals if len(one) == size and np.exp(one.mean[1]) > 2.0)
        z = np.array([1.2, *np.full(size - 1, 0.2)])
        amount, spread = amount_in_all(effects, _fit(proposal, recorded, z), 0, factor)
        # Monte Carlo error of both, which draw: 0.007 standard deviations and 2.1 % apart
        assert np.log(amount) == pytest.approx(mean, abs=0.015 * sd)
        assert spread / amount == pytest.approx(sd, rel=0.04)
        assert abs(amount - true) < 2.0 * spread
