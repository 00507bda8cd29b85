"""Evidence summed over the sizes of the mesh's unknown error and of the stiffness field."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.marginal import RowsAtScales
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.evidence import Sizes, evidence_of, sizes_of
from warpbrain.worlds.body.nuisances import FIELD, UNKNOWN_MESH, Nuisances
from warpbrain.worlds.body.stiffness_field import FieldSizes

FIELD_SIZES = np.array([0.25, 0.5, 1.0, 2.0])
LOG_PRIOR = np.log([0.1, 0.2, 0.6, 0.1])


@pytest.fixture
def base() -> Base:
    """40 points that move by 80 of noise: a rigid shift, uneven stiffness, and an unknown error of the mesh."""
    random = np.random.default_rng(1)
    places = random.uniform(size=(40, 3))
    kernel = np.exp(-np.sum((places[:, None] - places[None, ::4]) ** 2, axis=2) / 0.02)
    relative = np.kron(kernel, np.eye(3))
    families = {
        "registration": np.tile(np.eye(3), (40, 1)),
        FIELD: 2.0 * random.normal(size=(120, 12)),
        UNKNOWN_MESH: 0.006 * 80.0 * relative,
    }
    moved, sizes = np.full(120, 80.0), FieldSizes(FIELD_SIZES, LOG_PRIOR)
    nuisances = Nuisances(families, places[::4], 0.006, moved, relative, np.zeros((0, 0)), sizes)
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


def with_sizes(base: Base, fraction: float, field: float) -> np.ndarray:
    return base.nuisances.with_field(columns_at(base, fraction), field)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_mean_over_all_sizes(base, seed):
    residual = rows_of(base, 0.028, seed)
    columns, result = evidence_of(base, base.model.columns, residual, sizes_of(base))
    logs = np.array(
        [
            [
                RowsAtScales(base.model.of_noise(with_sizes(base, fraction, field)), residual, base.points)
                .summed()
                .log_evidence
                + log_prior
                for field, log_prior in zip(FIELD_SIZES.tolist(), LOG_PRIOR.tolist(), strict=True)
            ]
            for fraction in beliefs("mesh.unknown").tolist()
        ]
    )
    # terms below a hundredth of the largest are left out, and it is taken for a product over both sizes
    assert result.log_evidence == pytest.approx(np.logaddexp.reduce(logs, axis=None) - np.log(len(logs)), abs=0.05)
    assert logs[result.sizes.mesh, result.sizes.field] == logs.max()
    sizes = beliefs("mesh.unknown")[result.sizes.mesh], FIELD_SIZES[result.sizes.field]
    np.testing.assert_allclose(columns, with_sizes(base, *sizes), rtol=1e-12)


@pytest.mark.parametrize("field", range(len(FIELD_SIZES)))
def test_where_it_begins_does_not_matter(base, field):
    residual = rows_of(base, 0.013, 7)
    evidences = [
        evidence_of(base, with_sizes(base, fraction, FIELD_SIZES[field]), residual, Sizes(number, 0, field))[1]
        for number, fraction in enumerate(beliefs("mesh.unknown").tolist())
    ]
    known = evidence_of(base, base.model.columns, residual, sizes_of(base))[1]
    for evidence in evidences:
        assert evidence.log_evidence == pytest.approx(known.log_evidence, abs=0.05)
        assert evidence.sizes == known.sizes


@pytest.mark.parametrize("number", range(len(FIELD_SIZES)))
def test_how_uneven_stiffness_is_is_told(base, number):
    """Recordings of a stiffness field tell its size to one of a grid of factors of two."""
    field = FIELD_SIZES[number] * base.nuisances.families[FIELD]
    likely = []
    for seed in range(5):
        random = np.random.default_rng(seed)
        residual = rows_of(base, 0.006, seed) + field @ random.normal(size=field.shape[1])
        likely.append(evidence_of(base, base.model.columns, residual, sizes_of(base))[1].sizes.field)
    assert abs(np.median(likely) - number) <= 1


def test_a_case_that_declares_it_has_one_size(base):
    base.nuisances = replace(base.nuisances, field_sizes=FieldSizes.of(0.3))
    residual = rows_of(base, 0.006, 2)
    columns, result = evidence_of(base, base.model.columns, residual, sizes_of(base))
    part = base.nuisances.part(FIELD)
    np.testing.assert_array_equal(columns[:, part], base.model.columns[:, part])
    assert result.sizes.field == 0


def test_a_large_error_is_told_from_a_small_one(base):
    sizes = beliefs("mesh.unknown")
    likely = [
        [
            fraction_of(base, evidence_of(base, base.model.columns, rows_of(base, size, seed), sizes_of(base))[0])
            for seed in range(5)
        ]
        for size in (sizes[0], sizes[-1])
    ]
    assert np.median(likely[0]) <= sizes[1] and np.median(likely[1]) == sizes[-1]


def test_it_is_relative_to_what_the_causes_move(base):
    """Beside a cause that explains a displacement of 300 the error is a part of that, not of the base's 80."""
    cause = np.tile([300.0, 0.0, 0.0], 40)[:, None]
    recorded = cause[:, 0] + np.random.default_rng(5).normal(size=120)
    base.at.sensors.residual = recorded
    without, _ = evidence_of(base, base.model.columns[:, :], recorded, sizes_of(base))
    beside, _ = evidence_of(base, np.column_stack([base.model.columns, cause]), recorded, sizes_of(base))
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
    _, result = evidence_of(base, base.model.columns, residual, sizes_of(base))
    assert result.model.noise_factor is noise and not result.gross.any()
    known = SimpleNamespace(**{**vars(base), "noises": (base.noises[size],)})
    # what is not known costs no more than the number of sizes
    cost = evidence_of(known, base.model.columns, residual, sizes_of(base))[1].log_evidence - result.log_evidence
    assert 0.0 < cost <= np.log(3.0) + 1e-9


def test_a_body_that_does_not_move_has_none(base):
    families = base.nuisances.families | {UNKNOWN_MESH: np.zeros((120, 30))}
    still = replace(base.nuisances, families=families, displacement=np.zeros(120), field_sizes=FieldSizes.of(0.3))
    base.nuisances, base.model = still, GaussianModel(np.eye(120), still.columns)
    residual = np.random.default_rng(3).normal(size=120)
    columns, result = evidence_of(base, still.columns, residual, sizes_of(base))
    np.testing.assert_array_equal(columns, still.columns)
    assert result.log_evidence == RowsAtScales(base.model, residual, base.points).summed().log_evidence
