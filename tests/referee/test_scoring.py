"""Scores of diagnoses written by hand, whose answers are known."""

import json
from dataclasses import replace

import numpy as np
import pytest
from said import diagnosis, label, outcome, sealed_labels
from scipy.stats import binom, binomtest

from referee.__main__ import main
from referee.analysed import Analysis, with_conditionals
from referee.diagnoses import read_diagnosis
from referee.errors import InputError
from referee.intervals import Share
from referee.outcomes import read_outcomes
from referee.scores import amounts, calibration, confusion, shares
from warpbrain.physics.mechanisms import mechanisms


@pytest.mark.parametrize(("hits", "of"), [(0, 24), (1, 24), (23, 24), (24, 24), (5, 9)])
def test_intervals_are_exact(hits, of):
    low, high = Share(hits, of).interval
    exact = binomtest(hits, of).proportion_ci(method="exact")
    assert (low, high) == pytest.approx((exact.low, exact.high))
    if 0 < hits < of:
        # by definition: as few, and as many, are just plausible at the ends
        assert binom.sf(hits - 1, of, low) == pytest.approx(0.025)
        assert binom.cdf(hits, of, high) == pytest.approx(0.025)


def test_the_unit_of_every_parameter_is_known(tmp_path):
    for kind, mechanism in mechanisms().items():
        told = {name: {"value": 2.0, "sd": 1.0, "unit": spec.unit} for name, spec in mechanism.parameters().items()}
        found = outcome(tmp_path, label("c"), diagnosis("named", kind, 0.9, parameters=told)).said.parameters
        for name, spec in mechanism.parameters().items():
            assert found[name] == pytest.approx((2.0 * spec.si, spec.si)), (kind, name)


@pytest.fixture
def outcomes(tmp_path):
    where = {"centre_m": [0.0, 0.0, 0.006], "radius_m": 0.01}
    value = {"amount": {"value": 5.0, "sd": 1.0, "unit": "%"}}
    fit = {"declared": {"heldout_rmse_m": 5e-4}, "explained": {"heldout_rmse_m": 3e-4}}
    swollen = {"where_m": [0.0, 0.0, 0.0], "amount": 0.04, "parameter": "amount", "size": 0.04}
    pairs = [
        (label("n1"), diagnosis()),
        (label("n2"), diagnosis("named", "gravity", 0.9)),
        (label("n3"), diagnosis("cannot say", p_value=0.01)),
        (
            label("s1", "effect", ("swelling",), 12.0, **swollen),
            diagnosis("named", "swelling", 0.95, where=where, parameters=value, fit=fit),
        ),
        (label("g1", "effect", ("gravity",), 9.0), diagnosis("group", "gravity", 0.5, group=["gravity", "pressure"])),
        (label("p1", "effect", ("pressure",), 6.0), diagnosis("Named", "swelling", 0.9)),
        (label("p2", "effect", ("pressure",), 2.0), diagnosis()),
        (label("o1", "outside", ("tether",), 9.0), diagnosis("unknown")),
        (
            label("o2", "outside", ("pre-stress",), 9.0, also=["residual-stress"]),
            diagnosis("named", "residual-stress", 1.0),
        ),
        (label("t1", "trap", ("noise",)), diagnosis("not physics")),
        (label("t2", "trap", ("coarse",)), diagnosis("named+rest", "pressure", 0.9)),
        (
            label("2a", "two", ("gravity", "swelling"), 9.0, conditional=8.5),
            diagnosis("named", ["gravity", "swelling"], 0.9),
        ),
        (
            label("2b", "two", ("gravity", "pressure"), 9.0, conditional=5.5),
            diagnosis("named + rest", "gravity", 0.9),
        ),
    ]
    return [outcome(tmp_path, true, said) for true, said in pairs]


def test_shares(outcomes):
    found = {name: (value.hits, value.of) for name, value in shares(outcomes).items()}
    assert found["false alarms"] == (1, 3)
    assert found["significant where nothing is missing"] == (1, 3)
    assert found["traps named as physics"] == (1, 2)
    assert found["best candidate right, d >= 8"] == (2, 2)
    assert found["best candidate right, 5 <= d < 8"] == (0, 1)
    assert found["best candidate right, d < 3"] == (0, 1)
    assert found["right name or group holding it, d >= 8"] == (2, 2)
    assert found["right name alone, d >= 8"] == (1, 2)
    # right: s1, o2, 2a, 2b; wrong: n2, p1, t2
    assert found["spoken names right"] == (4, 7)
    assert found["centre within 10 mm"] == (1, 1)
    assert found["amount within 2 sd"] == (1, 1)
    assert found["unknown found"] == (1, 2)
    assert found["both of two named"] == (1, 2)
    # of each what it shows where the other is not known
    assert found["both of two named, each d >= 8"] == (1, 1)
    assert found["both of two named, each d >= 5"] == (1, 2)
    assert found["outside the dictionary, called by a wrong name"] == (0, 2)
    assert found["unknown found, d >= 8"] == (2, 2)
    assert found["one of two named"] == (2, 2)


def test_shares_by_what_the_tool_can_see(outcomes):
    assert shares(outcomes)["right name alone, the tool's d >= 8"].of == 0
    seen = {"s1": 7.0, "g1": 8.5, "p1": 8.0, "2a": 20.0}
    found = shares([replace(o, seen=seen.get(o.name)) for o in outcomes])
    told = {name: (value.hits, value.of) for name, value in found.items() if "the tool's d" in name}
    assert told["right name or group holding it, the tool's d >= 8"] == (1, 2)
    assert told["right name alone, the tool's d >= 8"] == (0, 2)


def test_what_is_measured(outcomes):
    found = amounts(outcomes)
    assert found["centre error [m]"]["median"] == pytest.approx(0.006)
    assert found["relative error of amount"]["median"] == pytest.approx(0.25)
    # all that was above the noise is gone
    assert found["held-out error above noise that is gone"]["median"] == pytest.approx(1.0)


def test_calibration_by_hand(outcomes):
    found = calibration(outcomes)["spoken"]
    p = [0.9, 0.95, 0.9, 1.0, 0.9, 0.9, 0.9]
    right = [0, 1, 0, 1, 0, 1, 1]
    assert found["rows"] == [[pytest.approx(np.mean(p)), pytest.approx(np.mean(right)), 7]]
    assert found["ece"] == pytest.approx(np.mean(p) - np.mean(right))


def test_every_stated_probability_counts_after_an_alarm(tmp_path):
    ranking = [
        {"mechanism": name, "probability": p, "log_evidence": e, "physics": name != "unknown"}
        for name, p, e in (("gravity", 0.7, 3.0), ("pressure", 0.25, 1.0), ("unknown", 0.05, 0.0), ("falx", 0.0, None))
    ]
    true = label("g", "effect", ("pressure",), 6.0)
    # of what acts, gravity does with 0.85 and gravity or pressure with 0.95
    sets = [
        (("gravity",), 0.6),
        (("pressure",), 0.1),
        (("gravity", "pressure"), 0.08),
        (("unknown",), 0.04),
        ((), 0.18),
    ]
    tried = [
        {
            "causes": causes,
            "kinds": ["unknown" if name == "unknown" else "physics" for name in causes],
            "log_evidence": 0.0,
            "log_prior": 0.0,
            "probability": p,
        }
        for causes, p in sets
    ]
    pairs = [
        (true, diagnosis("group", p_value=0.01, ranking=ranking, hypotheses=tried)),
        (label("n"), diagnosis(p_value=0.3, ranking=ranking)),
        (
            label("o", "outside", ("tether",), 6.0),
            diagnosis("unknown", p_value=0.01, ranking=ranking, hypotheses=tried),
        ),
    ]
    found = [outcome(tmp_path, *pair) for pair in pairs]
    told = calibration(found)["all"]
    # of what was tried: 0.05 twice, 0.25 twice and 0.7 twice
    assert told["rows"] == [[pytest.approx(0.05), 0.5, 2], [pytest.approx(0.25), 0.5, 2], [pytest.approx(0.7), 0.0, 2]]
    assert [row.name for row in found[0].said.label_set] == ["gravity", "pressure"]
    assert found[0].covered and not found[2].covered
    of_effects = shares(found)["90 % label set holds the truth"]
    assert (of_effects.hits, of_effects.of) == (1, 1)
    # of two names what is stated is that both act
    both = diagnosis("named", ["gravity", "pressure"], 0.78, hypotheses=tried)
    assert outcome(tmp_path, label("b"), both).said.probability == pytest.approx(0.08)


def test_confusion_counts_every_case_once(outcomes):
    rows, columns, table = confusion(outcomes)
    assert np.sum(table) == len(outcomes)
    assert table[rows.index("nothing")][columns.index("nothing")] == 1
    assert table[rows.index("gravity")][columns.index("right group")] == 1


def test_what_is_no_diagnosis_is_refused(tmp_path):
    file = tmp_path / "diagnosis.json"
    file.write_text(json.dumps(diagnosis("perhaps")))
    with pytest.raises(InputError, match="perhaps"):
        read_diagnosis(file)
    file.write_text("{}")
    with pytest.raises(InputError, match="verdict"):
        read_diagnosis(file)


def test_the_command_scores_and_refuses(tmp_path, outcomes, capsys):
    labels = tmp_path / "labels"
    sealed_labels(labels, *(dict(o.label) for o in outcomes), label("never"))
    words = ["score", "--cases", tmp_path, "--labels", labels, "--diagnoses", tmp_path, "--out", tmp_path / "out"]
    assert main([*map(str, words), "--no-baselines"]) == 0
    told = json.loads((tmp_path / "out" / "score.json").read_text())
    assert told["without_diagnosis"] == ["never"]
    assert told["shares"]["false alarms"]["hits"] == 1
    assert "| false alarms | 1 of 3 = 33 % (1 to 91) |  | <= 5 % | NOT met |" in capsys.readouterr().out
    assert main([*map(str, words), "--no-baselines", "--beside", f"plain={tmp_path}"]) == 0
    assert "| score, in cases of all | the run | plain | the optimal analyst |" in capsys.readouterr().out
    assert main([*map(str, words), "--no-baselines", "--beside", "plain=nowhere"]) == 2
    for name in ("confusion", "reliability", "accuracy"):
        assert (tmp_path / "out" / f"{name}.png").stat().st_size > 5000
    (labels / "commitments.txt").write_text("0" * 64 + "  n1\n")
    assert main([*map(str, words), "--no-baselines"]) == 2


def test_a_name_is_false_where_its_mechanism_was_left_out(tmp_path):
    said = [
        ("a", diagnosis("named", "pressure", 0.9)),
        ("b", diagnosis("unknown")),
        ("c", diagnosis("group", "pressure", 0.5, group=["pressure", "unknown"])),
        ("d", diagnosis()),
    ]
    found = [
        replace(outcome(tmp_path, label(name, "effect", ("gravity",), 9.0), told), left_out="gravity")
        for name, told in said
    ]
    # of another mechanism nothing changes
    also = replace(outcome(tmp_path, label("e", "effect", ("pressure",), 9.0), said[0][1]), left_out="gravity")
    told = {name: (value.hits, value.of) for name, value in shares([*found, also]).items()}
    assert told["mechanism left out, called by a name, d >= 8"] == (1, 4)
    assert told["mechanism left out, unknown or a group with it, d >= 8"] == (2, 4)
    assert told["right name alone, d >= 8"] == (1, 1)
    assert told["spoken names right"] == (1, 2)
    with (tmp_path / "runs.csv").open("w") as file:
        file.write("case,status,seconds,version,commit,arguments,left_out\na,0,1,1,c,,gravity\n")
    read, missing = read_outcomes({o.name: o.label for o in found[:2]} | {"z": label("z")}, tmp_path)
    assert [o.kind for o in read] == ["left out", "effect"] and not missing


def test_the_optimal_analyst_stands_beside(tmp_path, outcomes, capsys):
    sealed_labels(tmp_path / "labels", *(dict(o.label) for o in outcomes))
    analysed = tmp_path / "analysed"
    analysed.mkdir()
    sure, torn = [[["swelling"], 1.0]], [[["gravity"], 0.5], [["swelling"], 0.5]]
    draws = [{"p_value": 0.0, "sets": sets} for sets in (sure, torn, torn, torn)]
    (analysed / "s1.json").write_text(json.dumps({"conditional": [12.0], "draws": draws}))
    older = {**outcomes[-1].label, "effects": [{"detectability": 4.0}, {"detectability": 4.0}]}
    given = with_conditionals(older, Analysis((3.0, 2.0), ()))
    assert [effect["conditional"] for effect in given["effects"]] == [3.0, 2.0]
    words = ["score", "--cases", tmp_path, "--labels", tmp_path / "labels", "--diagnoses", tmp_path]
    words += ["--out", tmp_path / "out", "--no-baselines", "--analysed", analysed]
    assert main([*map(str, words)]) == 0
    told = capsys.readouterr().out
    # named in one of four residuals: the bar is 5 points below
    assert "| right name alone, d >= 8 | 1 of 2 = 50 % (1 to 99) | 25 % | >= 20 % (announced 92 %, above" in told
    assert json.loads((tmp_path / "out" / "score.json").read_text())["optimal"]["right name alone, d >= 8"] == 0.25
