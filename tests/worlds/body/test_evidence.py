"""Evidence summed over the size of the mesh's unknown error."""

from types import SimpleNamespace

import numpy as np
import pytest

from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.marginal import marginal
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.evidence import evidence_of
from warpbrain.worlds.body.nuisances import UNKNOWN_MESH, Family, Nuisances


@pytest.fixture
def base() -> Base:
    """40 points: a rigid shift, and an unknown error of the mesh of half a noise at a fraction of 0.006."""
    random = np.random.default_rng(1)
    places = random.uniform(size=(40, 3))
    kernel = np.exp(-np.sum((places[:, None] - places[None, ::4]) ** 2, axis=2) / 0.02)
    families = (
        Family("registration", np.tile(np.eye(3), (40, 1))),
        Family(UNKNOWN_MESH, 0.5 * np.kron(kernel, np.eye(3))),
    )
    nuisances = Nuisances(families, places[::4], 0.006)
    model = GaussianModel(np.eye(120), nuisances.columns)
    points = tuple(np.arange(3 * k, 3 * k + 3) for k in range(40))
    return SimpleNamespace(nuisances=nuisances, model=model, points=points, residual=np.zeros(120))  # type: ignore[return-value]


def rows_of(base: Base, fraction: float, seed: int) -> np.ndarray:
    """Rows drawn from noise, and an error of the mesh of some size alone."""
    random = np.random.default_rng(seed)
    columns = base.nuisances.at_fraction(base.model.columns, fraction)[:, base.nuisances.part(UNKNOWN_MESH)]
    return base.model.noise_factor @ random.normal(size=len(base.residual)) + columns @ random.normal(
        size=columns.shape[1]
    )


@pytest.mark.parametrize("fraction", beliefs("mesh.unknown"))
def test_the_size_of_columns_is_read_back(base, fraction):
    columns = base.nuisances.at_fraction(base.model.columns, fraction)
    np.testing.assert_allclose(base.nuisances.fraction_of(columns), fraction)
    others = np.delete(columns - base.model.columns, np.r_[base.nuisances.part(UNKNOWN_MESH)], axis=1)
    assert not others.any()


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_mean_over_all_sizes(base, seed):
    residual = rows_of(base, 0.028, seed)
    columns, result = evidence_of(base, base.model.columns, residual)
    logs = [
        marginal(
            base.model.of_noise(base.nuisances.at_fraction(base.model.columns, fraction)), residual, base.points
        ).log_evidence
        for fraction in beliefs("mesh.unknown").tolist()
    ]
    # terms below a hundredth of the largest are left out
    np.testing.assert_allclose(result.log_evidence, np.logaddexp.reduce(logs) - np.log(len(logs)), atol=0.05)
    assert base.nuisances.fraction_of(columns) == pytest.approx(beliefs("mesh.unknown")[np.argmax(logs)])


def test_where_it_begins_does_not_matter(base):
    residual = rows_of(base, 0.013, 7)
    evidences = [
        evidence_of(base, base.nuisances.at_fraction(base.model.columns, fraction), residual)[1].log_evidence
        for fraction in beliefs("mesh.unknown").tolist()
    ]
    np.testing.assert_allclose(evidences, evidences[0], atol=0.05)


def test_a_large_error_is_told_from_a_small_one(base):
    sizes = beliefs("mesh.unknown")
    likely = [
        [
            base.nuisances.fraction_of(evidence_of(base, base.model.columns, rows_of(base, size, seed))[0])
            for seed in range(5)
        ]
        for size in (sizes[0], sizes[-1])
    ]
    assert np.mean(likely[0]) < np.mean(likely[1])


def test_a_body_that_does_not_move_has_none(base):
    still = Nuisances(
        (base.nuisances.families[0], Family(UNKNOWN_MESH, np.zeros((120, 30)))), base.nuisances.anchors, 0.06
    )
    base.nuisances, base.model = still, GaussianModel(np.eye(120), still.columns)
    residual = np.random.default_rng(3).normal(size=120)
    columns, result = evidence_of(base, still.columns, residual)
    np.testing.assert_array_equal(columns, still.columns)
    assert result.log_evidence == marginal(base.model, residual, base.points).log_evidence
