"""The unknown part of the mesh's error is learned, and what is missing is not taken for it."""

import numpy as np
import pytest

from warpbrain.diagnosis.fraction import likely_fraction
from warpbrain.inference.beliefs import beliefs
from warpbrain.worlds.body.nuisances import Family, Nuisances

ROWS = 300

FRACTION = float(beliefs("mesh.unknown").max())


@pytest.fixture
def made() -> tuple[np.random.Generator, Nuisances, np.ndarray]:
    random = np.random.default_rng(3)
    tissue = Family("tissue", random.normal(size=(ROWS, 2)))
    mesh = Family("mesh, unknown", 3.0 * random.normal(size=(ROWS, 60)) / np.sqrt(60.0))
    smooth = random.normal(size=(ROWS, 20)) / np.sqrt(20.0)
    return random, Nuisances((tissue, mesh), np.zeros((20, 3)), FRACTION), smooth


@pytest.mark.parametrize("part", [0.1, 0.35, 1.0])
def test_a_fraction_is_found_again(made, part):
    random, nuisances, smooth = made
    truth = nuisances.with_fraction(part * FRACTION).columns
    residual = truth @ random.normal(size=truth.shape[1]) + random.normal(size=ROWS)
    found = likely_fraction(np.eye(ROWS), nuisances, residual, [smooth])
    assert 0.5 < found / (part * FRACTION) < 2.0


def test_what_is_missing_is_not_an_error_of_the_mesh(made):
    random, nuisances, smooth = made
    residual = 30.0 * smooth @ random.normal(size=smooth.shape[1]) + random.normal(size=ROWS)
    found = likely_fraction(np.eye(ROWS), nuisances, residual, [10.0 * smooth, 30.0 * smooth])
    assert found < 0.35 * FRACTION


def test_only_the_last_family_is_scaled(made):
    _, nuisances, _ = made
    other = nuisances.with_fraction(0.5 * FRACTION)
    assert other.fraction == 0.5 * FRACTION
    np.testing.assert_array_equal(other.families[0].columns, nuisances.families[0].columns)
    np.testing.assert_allclose(other.families[-1].columns, 0.5 * nuisances.families[-1].columns)
