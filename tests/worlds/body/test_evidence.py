"""Evidence summed over the size of the mesh's unknown error."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.gross_errors import RowsAtScales
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.nuisances import UNKNOWN_MESH, Nuisances
from warpbrain.worlds.body.weighted_set import evidence_of


@pytest.fixture
def base() -> Base:
    """40 points that move by 80 of noise: a rigid shift, and an unknown error of the mesh."""
    random = np.random.default_rng(1)
    places = random.uniform(size=(40, 3))
    kernel = np.exp(-np.sum((places[:, None] - places[None, ::4]) ** 2, axis=2) / 0.02)
    relative = np.kron(kernel, np.eye(3))
    families = {"registration": np.tile(np.eye(3), (40, 1)), UNKNOWN_MESH: 0.006 * 80.0 * relative}
    nuisances = Nuisances(families, places[::4], 0.006, np.full(120, 80.0), relative)
    model = GaussianModel(np.eye(120), nuisances.columns)
    points = tuple(np.arange(3 * k, 3 * k + 3) for k in range(40))
    sensors = SimpleNamespace(
        residual=np.zeros(120),
        computed=np.zeros(120),
        groups=np.repeat(np.arange(40), 3),
        is_displacement=np.ones(120, dtype=bool),
    )
    return SimpleNamespace(  # type: ignore[return-value]
        nuisances=nuisances,
        model=model,
        noises=(GaussianModel(model.noise_factor, np.zeros((120, 0))),),
        points=points,
        residual=np.zeros(120),
        at=SimpleNamespace(sensors=sensors),
    )


def columns_at(base: Base, fraction: float, displacement: float = 80.0) -> np.ndarray:
    nuisances = base.nuisances
    return nuisances.with_family("mesh, unknown", base.model.columns, fraction * displacement * nuisances.relative)


def rows_of(base: Base, fraction: float, seed: int) -> np.ndarray:
    """Rows drawn from noise, and an error of the mesh of some size alone."""
    random = np.random.default_rng(seed)
    columns = columns_at(base, fraction)[:, base.nuisances.part(UNKNOWN_MESH)]
    return base.model.noise_factor @ random.normal(size=len(base.residual)) + columns @ random.normal(
        size=columns.shape[1]
    )


def fraction_of(base: Base, columns: np.ndarray) -> float:
    part = base.nuisances.part(UNKNOWN_MESH)
    return float(np.linalg.norm(columns[:, part]) / np.linalg.norm(80.0 * base.nuisances.relative))


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_mean_over_all_sizes(base, seed):
    residual = rows_of(base, 0.028, seed)
    columns, result = evidence_of(base, base.model.columns, residual)
    logs = [
        RowsAtScales(base.model.of_noise(columns_at(base, fraction)), residual, base.points).summed().log_evidence
        for fraction in beliefs("mesh.unknown").tolist()
    ]
    # terms below a hundredth of the largest are left out
    np.testing.assert_allclose(result.log_evidence, np.logaddexp.reduce(logs) - np.log(len(logs)), atol=0.05)
    assert fraction_of(base, columns) == pytest.approx(beliefs("mesh.unknown")[np.argmax(logs)])


def test_where_it_begins_does_not_matter(base):
    residual = rows_of(base, 0.013, 7)
    evidences = [
        evidence_of(base, columns_at(base, fraction), residual)[1].log_evidence
        for fraction in beliefs("mesh.unknown").tolist()
    ]
    np.testing.assert_allclose(evidences, evidences[0], atol=0.05)


def test_a_large_error_is_told_from_a_small_one(base):
    sizes = beliefs("mesh.unknown")
    likely = [
        [fraction_of(base, evidence_of(base, base.model.columns, rows_of(base, size, seed))[0]) for seed in range(5)]
        for size in (sizes[0], sizes[-1])
    ]
    assert np.median(likely[0]) <= sizes[1] and np.median(likely[1]) == sizes[-1]


def test_it_is_relative_to_what_the_causes_move(base):
    """Beside a cause that explains a displacement of 300 the error is a part of that, not of the base's 80."""
    cause = np.tile([300.0, 0.0, 0.0], 40)[:, None]
    recorded = cause[:, 0] + np.random.default_rng(5).normal(size=120)
    base.at.sensors.residual = recorded
    without, _ = evidence_of(base, base.model.columns[:, :], recorded)
    beside, _ = evidence_of(base, np.column_stack([base.model.columns, cause]), recorded)
    part = base.nuisances.part(UNKNOWN_MESH)
    shares = [np.linalg.norm(columns[:, part], axis=1) for columns in (without, beside)]
    fractions = beliefs("mesh.unknown")
    moved = np.linalg.norm(base.nuisances.relative, axis=1)
    ratio = shares[1] / moved
    assert min(abs(ratio[0] / 300.0 - fraction) for fraction in fractions) < 0.01 * fractions.min()
    np.testing.assert_allclose(ratio, ratio[0], rtol=0.05)


@pytest.mark.parametrize("size", [0, 1, 2])
def test_what_is_not_resolved_has_its_size(base, size):
    excess = np.where(np.arange(120) < 60, 1.0, 0.0)
    base.noises = tuple(GaussianModel(np.diag(1.0 + k * excess), np.zeros((120, 0))) for k in (0.0, 2.0, 6.0))
    noise = base.noises[size].noise_factor
    residual = noise @ np.random.default_rng(11).normal(size=120)
    _, result = evidence_of(base, base.model.columns, residual)
    assert result.model.noise_factor is noise and not result.gross.any()
    known = SimpleNamespace(**{**vars(base), "noises": (base.noises[size],)})
    # what is not known costs no more than the number of sizes
    cost = evidence_of(known, base.model.columns, residual)[1].log_evidence - result.log_evidence
    assert 0.0 < cost <= np.log(3.0) + 1e-9


def test_a_body_that_does_not_move_has_none(base):
    families = base.nuisances.families | {UNKNOWN_MESH: np.zeros((120, 30))}
    still = replace(base.nuisances, families=families, displacement=np.zeros(120))
    base.nuisances, base.model = still, GaussianModel(np.eye(120), still.columns)
    residual = np.random.default_rng(3).normal(size=120)
    columns, result = evidence_of(base, still.columns, residual)
    np.testing.assert_array_equal(columns, still.columns)
    assert result.log_evidence == RowsAtScales(base.model, residual, base.points).summed().log_evidence
