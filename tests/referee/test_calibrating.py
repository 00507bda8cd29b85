"""Temperatures and weights of hypotheses whose right ones are known, and the file that the tool reads."""

import json

import numpy as np
import pytest
from said import diagnosis, label, outcome, sealed_labels

from referee.__main__ import main
from referee.calibrate import FILE, PRICES, priced, true_of
from referee.diagnoses import NOT_PHYSICS, UNKNOWN, Tried
from referee.reliability import reliability
from referee.temperature import Ballot, Scale, fit, held_out, interval, log_loss

SETS = [(), ("gravity",), ("pressure",), ("swelling",), ("gravity", "pressure"), ("gravity", "swelling")]
SETS += [("gravity", "pressure", "swelling"), (UNKNOWN,), ("gravity", UNKNOWN), (NOT_PHYSICS,)]
TRUE = Scale(2.0, (1.5, -1.0, -2.0, 1.0))


def ballots(cases, seed=0, scale=TRUE):
    """Cases whose truth is drawn with the probabilities of a scale."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(cases):
        tried = tuple(Tried(frozenset(causes), 5.0 * random.normal()) for causes in SETS)
        truth = random.choice(len(tried), p=scale.probabilities(tried))
        found.append(Ballot(tried, np.arange(len(tried)) == truth))
    return found


def test_the_right_scale_is_found(verify):
    # how often a made set has each kind of truth is its maker's choice, and is not kept
    found = fit(ballots(1500))
    # Monte Carlo error of 1,500 truths: 3 %
    verify(
        "temperature of log evidences, from 1,500 truths drawn with a known one",
        "the temperature they were drawn with",
        abs(found.temperature / TRUE.temperature - 1.0),
        0.08,
    )
    assert found.weights == Scale().weights


def test_nothing_known_leaves_the_scale_as_it_is():
    even = [Ballot(b.hypotheses, np.ones(len(SETS), dtype=bool)) for b in ballots(20)]
    found = fit(even)
    assert (found.temperature, *found.weights) == pytest.approx((1.0, 0.0, 0.0, 0.0, 0.0), abs=1e-4)


def test_intervals_hold_the_right_scale_and_held_out_probabilities_are_right():
    given = ballots(150, seed=1, scale=Scale(TRUE.temperature))
    low, high = interval(given, draws=30)
    assert low < TRUE.temperature < high
    p, right = held_out(given), np.concatenate([b.right for b in given])
    plain = [Scale(1.0).probabilities(b.hypotheses) for b in given]
    assert reliability(np.concatenate(p), right)["ece"] < reliability(np.concatenate(plain), right)["ece"]
    assert log_loss(fit(given), given) < log_loss(Scale(1.0), given)


def test_the_true_set_of_each_kind_of_case(tmp_path):
    def true(kind, names, **effect):
        found = outcome(tmp_path, label("c", kind, names, 9.0, **effect), diagnosis())
        return {causes for causes in SETS if true_of(found, Tried(frozenset(causes), 0.0))}

    assert true("none", ()) == {()}
    assert true("effect", ("gravity",)) == {("gravity",)}
    assert true("outside", ("tether",), also=["swelling"]) == {(UNKNOWN,), ("swelling",)}
    # or noise and gross errors, which every set has
    assert true("trap", ("registration",)) == {(), (NOT_PHYSICS,)}
    assert true("two", ("gravity", "pressure")) == {("gravity", "pressure")}


def hypotheses(**logs):
    kinds = {"unknown": "unknown", "registration": "not physics"}
    return [
        {
            "causes": [] if name == "nothing" else name.split("_"),
            "kinds": [] if name == "nothing" else [kinds.get(cause, "physics") for cause in name.split("_")],
            "log_evidence": log,
            "log_prior": -1.0,
            "probability": 0.1,
        }
        for name, log in logs.items()
    ]


def test_the_command_writes_what_the_tool_reads(tmp_path, capsys):
    labels = []
    for k in range(20):
        kinds = [("effect", ("gravity",)), ("outside", ("swirl",)), ("trap", ("registration",)), ("none", ())]
        labels.append(label(f"c{k}", *kinds[k % 4], 9.0))
        best = ("gravity", "unknown", "registration", "nothing")[k % 4]
        tried = {"gravity": 3.0, "pressure": 2.0, "unknown": 2.0, "registration": 2.0, "nothing": 2.0}
        tried |= {best: 9.0, "gravity_pressure": 1.0}
        outcome(tmp_path, labels[-1], diagnosis("cannot say", hypotheses=hypotheses(**tried)))
        (tmp_path / f"c{k}" / "case.toml").touch()
    sealed_labels(tmp_path / "labels", *labels)
    file = tmp_path / "calibration.json"
    words = ["calibrate", "--cases", tmp_path, "--labels", tmp_path / "labels", "--diagnoses", tmp_path]
    words += ["--write", file]
    assert main([*map(str, words)]) == 0
    assert "fitted to 20: 5 none, 5 effect, 0 two, 5 outside, 5 trap" in capsys.readouterr().out
    told, now = json.loads(file.read_text()), json.loads(FILE.read_text())
    assert set(told) == set(now) and set(told["losses"]) == set(now["losses"])
    assert told["temperature"] > 0.0 and told["losses"]["cannot say"] == now["losses"]["cannot say"]
    for k in range(11):
        (tmp_path / f"c{k}" / "diagnosis.json").unlink()
    assert main([*map(str, words)]) == 2
    assert "in 9 of 9 cases; expected 10" in capsys.readouterr().err


def test_a_false_name_costs_more_where_names_are_often_false(tmp_path):
    losses = json.loads(FILE.read_text())["losses"]
    tried = (Tried(frozenset({"gravity"}), 0.0), Tried(frozenset({"pressure"}), 0.0))
    given = [Ballot(tried, np.array([True, False]))] * 40
    stated = [np.array([0.98, 0.02])] * 40
    right = [outcome(tmp_path, label(f"r{k}", "effect", ("gravity",), 9.0), diagnosis(p_value=0.01)) for k in range(40)]
    wrong = [outcome(tmp_path, label(f"w{k}", "effect", ("pressure",), 9.0), diagnosis(p_value=0.01)) for k in range(8)]
    cheap, _ = priced(right, given, stated, losses)
    dear, spoken = priced([*right[8:], *wrong], given, stated, losses)
    assert dear["false name"] > cheap["false name"] and spoken.of == 0
    assert cheap["false name"] == PRICES[0] and dear["false group"] == cheap["false group"] == losses["false group"]
    # one in forty that no price takes away
    assert priced([*right[1:], wrong[0]], given, stated, losses)[0] == cheap
    few, counted = priced(right[:20], given[:20], stated[:20], losses)
    assert few == losses and counted.of <= 20
