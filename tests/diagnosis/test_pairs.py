"""Two places that draw each other: their evidence is that of every pair, and they are no smooth force."""

from types import SimpleNamespace

import numpy as np
import pytest

from warpbrain.diagnosis.evidence import Explanation, log_mean
from warpbrain.diagnosis.pairs import SIZES, PairEvidence, Pairs, pairs_at
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.diagnosis.screening import log_unknown

N, PLACES, NOISE = 40, 6, 0.3


@pytest.fixture(scope="module")
def few() -> tuple[Explanation, Pairs]:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(N, N))
    explanation = Explanation(np.linalg.cholesky(0.02 * root @ root.T + np.eye(N)), rng.normal(size=(N, 4)))
    count = PLACES * (PLACES - 1) // 2
    return explanation, Pairs(rng.normal(size=(PLACES, 3)), rng.normal(size=(N, 3 * PLACES)), rng.uniform(1, 2, count))


def test_evidence_is_the_mean_over_every_pair_spelled_out(few: tuple[Explanation, Pairs]) -> None:
    explanation, pairs = few
    residuals = np.random.default_rng(2).normal(size=(N, 300))
    each = []
    number = 0
    for i in range(PLACES):
        for j in range(i + 1, PLACES):
            along = pairs.sites[j] - pairs.sites[i]
            along /= np.linalg.norm(along)
            column = pairs.columns[:, 3 * i : 3 * i + 3] @ along - pairs.columns[:, 3 * j : 3 * j + 3] @ along
            column *= pairs.scales[number]
            np.testing.assert_allclose(pairs.column(number)[:, 0], column, rtol=1e-12)
            each += [explanation.with_more(size * NOISE * column[:, None]).log_marginal(residuals) for size in SIZES]
            number += 1
    found = PairEvidence(explanation, pairs.seen(lambda rows: rows), NOISE).log_marginal(residuals)
    np.testing.assert_allclose(found, log_mean(np.array(each)), rtol=1e-9)


def test_the_most_probable_pair_is_the_one_that_acts(few: tuple[Explanation, Pairs]) -> None:
    explanation, pairs = few
    for number in (0, 4, 11):
        residual = explanation.whitened(6.0 * pairs.column(number))[:, 0]
        best = PairEvidence(explanation, pairs, NOISE).best(residual)
        np.testing.assert_allclose(
            best / np.linalg.norm(best), pairs.column(number) / np.linalg.norm(pairs.column(number))
        )


def test_a_pair_is_scaled_and_is_two_opposite_forces(small_diagnosis: Diagnosis) -> None:
    base = small_diagnosis.base
    rows = base.at.sensors.is_displacement
    lengths = [np.sqrt(np.mean(base.pairs.column(k)[rows] ** 2)) for k in range(0, len(base.pairs.scales), 97)]
    assert max(lengths) == pytest.approx(1.0)
    assert np.median(lengths) == pytest.approx(1.0)
    # with the forces themselves in place of what is seen of them
    mesh = base.at.system.model.mesh
    own = pairs_at(base.at, 0.012)
    assert own.columns.shape == (len(base.at.sensors), 3 * len(own.sites))
    forces = np.zeros((2, 3))
    forces[0], forces[1] = own.along[5], -own.along[5]
    ends = own.sites[[own.ends[0][5], own.ends[1][5]]]
    np.testing.assert_allclose(np.cross(ends, forces).sum(axis=0), 0.0, atol=1e-15)
    assert np.isin(own.sites[:, 0], mesh.points[:, 0]).all()


def test_a_body_that_is_held_all_around_has_places_inside(small_diagnosis: Diagnosis) -> None:
    at = small_diagnosis.base.at
    mesh = at.system.model.mesh
    held = np.zeros(mesh.points.shape, dtype=bool)
    held[mesh.boundary.ravel()] = True
    model = SimpleNamespace(mesh=mesh, constrained=held.ravel())
    system = SimpleNamespace(model=model)
    given = SimpleNamespace(system=system, answers_of_patches=at.answers_of_patches, sensors=at.sensors)
    inside = ~held.all(axis=1)
    found = pairs_at(given, 0.012)
    assert 1 < len(found.sites) <= inside.sum()
    assert np.isin(found.sites[:, 0], mesh.points[inside, 0]).all()


def test_two_places_that_draw_each_other_are_no_smooth_force(small_diagnosis: Diagnosis) -> None:
    base = small_diagnosis.base
    explanation, noise = base.explanation, base.typical_noise
    pairs = PairEvidence(explanation, base.pairs, noise)
    smooth = [explanation.with_more(columns) for columns in base.smooth_forces]
    draws = explanation.draws(60, 1.0, np.random.default_rng(3))
    none = explanation.log_marginal(draws)
    # nothing acts: what has no name is less probable, in the mean over all that may be recorded no more so
    assert np.mean(pairs.log_marginal(draws) - none > 3.0) < 0.05
    number = int(np.random.default_rng(4).integers(len(base.pairs.scales)))
    drawn = draws + 6.0 * noise * explanation.whitened(base.pairs.column(number))
    gain = pairs.log_marginal(drawn) - log_unknown(smooth, drawn)
    assert np.median(gain) > 3.0


def test_standardised_pairs_have_the_same_evidence(few: tuple[Explanation, Pairs]) -> None:
    explanation, pairs = few
    residuals = explanation.draws(5, 1.2, np.random.default_rng(5))
    known = PairEvidence(explanation, pairs, NOISE)
    kappa = np.array([1.2])
    factor = known.log_marginal(residuals, kappa) - explanation.log_marginal(residuals, kappa)
    bare = Explanation(np.eye(N), np.zeros((N, 0)))
    seen = pairs.seen(lambda rows: explanation.standardised(explanation.whitened(rows), 1.2))
    own = explanation.standardised(residuals, 1.2)
    alike = PairEvidence(bare, seen, NOISE).log_marginal(own, np.ones(1)) - bare.log_marginal(own, np.ones(1))
    np.testing.assert_allclose(alike, factor, rtol=1e-9, atol=1e-9)


def test_pairs_are_drawn_with_each_size(few: tuple[Explanation, Pairs]) -> None:
    explanation, pairs = few
    evidence, rng = PairEvidence(explanation, pairs, NOISE), np.random.default_rng(6)
    columns = np.column_stack([pairs.column(k) for k in range(len(pairs.scales))])
    lengths = np.linalg.norm(columns, axis=0)
    found = set()
    for _ in range(300):
        drawn = evidence.drawn(rng)[:, 0]
        number = int(np.argmax(np.abs(columns.T @ drawn) / lengths))
        found.add((number, round(float(np.linalg.norm(drawn) / lengths[number] / NOISE), 6)))
    assert found == {(number, size) for number in range(len(lengths)) for size in SIZES}
