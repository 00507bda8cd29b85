"""Temperatures of evidences whose right temperature is known."""

import numpy as np
import pytest
from said import diagnosis, label, outcome, sealed_labels

from referee.__main__ import main
from referee.reliability import reliability
from referee.temperature import Ballots, Scale, conformal, fit, held_out, intervals

TRUE = Scale(3.0, -4.0, 2.0)


def ballots(cases, kinds=9, seed=0):
    """Cases whose truth is drawn with the probabilities of `TRUE`; the last two kinds are unknown and no physics."""
    random = np.random.default_rng(seed)
    evidence = random.normal(0.0, 9.0, size=(cases, kinds))
    evidence[random.random(evidence.shape) < 0.2] = -np.inf
    evidence[:, 0] = 0.0
    unknown, alternative = (np.arange(kinds) == k for k in (kinds - 1, kinds - 2))
    flags = [np.tile(flag, (cases, 1)) for flag in (unknown, alternative)]
    p = Ballots(evidence, np.zeros(evidence.shape, dtype=bool), *flags).probabilities(TRUE)
    truth = [random.choice(kinds, p=row) for row in p]
    return Ballots(evidence, np.arange(kinds) == np.array(truth)[:, None], *flags)


def test_the_right_scale_is_found():
    found = fit(ballots(3000))
    # Monte Carlo error of 3,000 truths: 2.9 %, 0.12 and 0.17 off
    assert found.temperature == pytest.approx(TRUE.temperature, rel=0.05)
    assert found.unknown == pytest.approx(TRUE.unknown, abs=0.25)
    assert found.alternative == pytest.approx(TRUE.alternative, abs=0.3)


def test_intervals_hold_the_right_scale_and_held_out_probabilities_are_right():
    given = ballots(150, seed=1)
    low, high = intervals(given, draws=60)
    for name in ("temperature", "unknown", "alternative"):
        assert getattr(low, name) < getattr(TRUE, name) < getattr(high, name)
    p = held_out(given)
    np.testing.assert_allclose(p.sum(axis=1), 1.0)
    tried = np.isfinite(given.evidence)
    plain = given.probabilities(Scale(1.0, 0.0, 0.0))
    assert reliability(p[tried], given.right[tried])["ece"] < reliability(plain[tried], given.right[tried])["ece"]
    assert -np.log((p * given.right).sum(axis=1)).mean() < given.loss(Scale(1.0, 0.0, 0.0))


def test_the_threshold_of_the_alarm_by_hand():
    p = [0.01 * k for k in range(1, 40)]
    # 39 cases: the second smallest, and an alarm below it is one of forty
    assert conformal(p, 0.05) == pytest.approx(0.02)
    assert conformal(p[:18], 0.05) is None
    random = np.random.default_rng(0)
    false = [random.random() < conformal(random.random(39).tolist(), 0.05) for _ in range(4000)]
    # Monte Carlo error of 4,000 alarms: 0.0034; 0.002 off
    assert np.mean(false) == pytest.approx(0.05, abs=0.005)


def rows(**evidence):
    kinds = {"registration": False, "unknown": False}
    return [
        {"mechanism": k, "probability": 0.2, "log_evidence": e, "physics": kinds.get(k, True)}
        for k, e in evidence.items()
    ]


def test_the_command_prints_what_it_found(tmp_path, capsys):
    labels = []
    for k in range(14):
        kind, names = [("effect", ("gravity",)), ("outside", ("tether",)), ("trap", ("registration",))][k % 3]
        labels.append(label(f"c{k}", kind, names, 9.0))
        said = rows(gravity=5.0 + k % 2, pressure=3.0, unknown=4.0, registration=2.0)
        outcome(tmp_path, labels[-1], diagnosis("cannot say", p_value=0.001, ranking=said))
    for k in range(20):
        labels.append(label(f"n{k}"))
        outcome(tmp_path, labels[-1], diagnosis(p_value=0.04 + 0.04 * k))
    sealed_labels(tmp_path / "labels", *labels)
    words = ["calibrate", "--cases", tmp_path, "--labels", tmp_path / "labels", "--diagnoses", tmp_path]
    assert main([*map(str, words)]) == 0
    told = capsys.readouterr().out
    assert "fitted to 14 with an alarm: 5 effect, 0 two, 5 outside, 4 trap" in told
    assert "temperature" in told and "p < 0.0400" in told
    (tmp_path / "c3" / "diagnosis.json").unlink()
    for k in range(5, 14):
        (tmp_path / f"c{k}" / "diagnosis.json").unlink()
    assert main([*map(str, words)]) == 2
    assert "4 cases in which something is missing" in capsys.readouterr().err
