"""Virtual cases: noise alone rarely alarms, what is plainly seen is named, what is alike ends in a group."""

from types import SimpleNamespace

import numpy as np
import pytest

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.diagnosis.result import NOT_PHYSICS, NOTHING, WITH_IT, Confusion
from warpbrain.diagnosis.screening import Screening
from warpbrain.diagnosis.sentences import confusion_sentences
from warpbrain.diagnosis.virtual import SIZES, VirtualCases
from warpbrain.worlds.body.dictionary import Candidates
from warpbrain.worlds.body.effects import Effect

N = 60


def proposal(columns):
    """What virtual cases ask of a proposal."""
    k = columns.shape[1]
    return SimpleNamespace(mean=np.zeros(k), sd=np.ones(k), without=np.zeros(k), is_there_or_not=False)


@pytest.fixture(scope="module")
def virtual():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(N, N))
    explanation = Explanation(np.linalg.cholesky(0.02 * root @ root.T + np.eye(N)), rng.normal(size=(N, 4)))
    plain, shared, weak, wrong = (rng.normal(size=(N, 1)) for _ in range(4))
    columns = {"plain": [3.0 * plain], "one": [3.0 * shared], "other": [3.0 * shared], "weak": [0.02 * weak]}
    # what no sensor sees
    columns["unseen"] = [0.0 * weak]
    effects = [Effect(proposal(c), np.zeros(N), c) for own in columns.values() for c in own]
    effects.append(Effect(None, np.zeros(N), 4.0 * wrong))
    of_kind = {kind: np.array([k]) for k, kind in enumerate((*columns, "registration"))}
    candidates = Candidates(tuple(of_kind), tuple(effects), of_kind, frozenset({"registration"}), {})
    # few directions: any two single effects are told from a force without a name
    screening = Screening(explanation, candidates, [rng.normal(size=(N, 12))])
    return VirtualCases(screening, 1.1, 0.05, np.random.default_rng(2)), screening


@pytest.fixture(scope="module")
def confusion(virtual) -> Confusion:
    return virtual[0].confusion(200, 60)


@pytest.mark.parametrize("kappa", [0.7, 2.0])
def test_standardised_rows_have_the_length_that_detectability_counts(virtual, kappa):
    explanation = virtual[1].explanation
    rows = np.random.default_rng(3).normal(size=(N, 5))
    own = explanation.standardised(rows, kappa)
    np.testing.assert_allclose(own.T @ own, rows.T @ explanation.precision_times(rows, kappa), rtol=1e-9, atol=1e-9)
    drawn = explanation.standardised(explanation.draws(20_000, kappa, np.random.default_rng(4)), kappa)
    # Monte Carlo error of 20,000 draws: 0.007, on the diagonal 0.010; the largest of all is 0.026
    np.testing.assert_allclose(np.cov(drawn), np.eye(N), atol=0.04)


def test_evidence_is_that_of_screening_at_one_factor(virtual):
    cases, screening = virtual
    residuals = np.random.default_rng(5).normal(size=(N, 3))
    whole = screening.of_effects.log_factors(residuals, np.array([1.1]))[0]
    known = cases.screening.run(screening.explanation.standardised(residuals, 1.1)).places
    np.testing.assert_allclose(known, whole, rtol=1e-7, atol=1e-7)


def test_noise_alone_rarely_alarms(confusion):
    assert confusion.rows[NOTHING][NOTHING] > 0.88
    assert confusion.rows["weak"][NOTHING] > 0.88


def test_what_is_plainly_seen_is_named(confusion):
    # its size is normal, so that a part of them is small
    assert confusion.rows["plain"]["plain"] > 0.7
    assert confusion.rows["registration"][NOT_PHYSICS] > 0.8
    assert confusion.named["plain"][-1] > 0.95 and confusion.named["plain"][0] < 0.5


def test_what_looks_alike_is_never_named(confusion):
    for kind in ("one", "other"):
        assert kind not in confusion.rows[kind]
        assert confusion.rows[kind][WITH_IT] > 0.8


def test_what_would_have_to_be_implausible_is_not_counted(confusion):
    assert confusion.alarm["weak"][SIZES.index(5.0) :] == (None,) * (len(SIZES) - SIZES.index(5.0))
    assert np.isinf(confusion.needed(confusion.named, "weak", 0.5))


def test_the_size_that_is_needed_lies_between_neighbours():
    confusion = Confusion(10, {}, (2.0, 4.0, 8.0), {"a": (0.2, 0.6, 1.0)}, {"a": (None, 0.0, 0.4)})
    assert confusion.needed(confusion.alarm, "a", 0.9) == pytest.approx(7.0)
    assert np.isinf(confusion.needed(confusion.named, "a", 0.5))


def test_what_no_sensor_sees_has_no_size(confusion):
    assert confusion.alarm["unseen"] == (None,) * len(SIZES)
    assert confusion.rows["unseen"][NOTHING] > 0.88


def test_alarms_grow_with_detectability(confusion):
    assert 2.0 < confusion.needed(confusion.alarm, "plain", 0.9) < 6.0


def test_it_is_said_in_two_sentences(confusion):
    first, second = confusion_sentences(confusion)
    assert "plain" in first and "hardly ever: one, other, unseen, weak" in first and "optimistic" in second
