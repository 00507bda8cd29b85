"""Every verdict is described with the same keys: the contract of `diagnosis.json`."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sinking_block import OPTIONS, verdict_of

from referee.diagnoses import read_diagnosis
from warpbrain.diagnosis.checking import distance
from warpbrain.inference import Kind
from warpbrain.inference.decide import VERDICTS
from warpbrain.report.diagnosis.description import describe
from warpbrain.report.diagnosis.text import shown_of
from warpbrain.report.files import write_summary

KEYS = {
    *("verdict", "sentence", "p_value", "mechanism", "probability", "parameters", "where", "when", "ranking", "group"),
    *("mechanisms", "unknown", "hypotheses", "log_evidence_of_nothing", "by_posterior", "doubts", "p_left"),
    *("next_measurement", "smallest_detectable", "confusion", "fit", "map", "assumptions", "remarks", "case"),
    *("inputs_sha256", "options", "seconds", "equilibria", "device", "versions"),
}
FIT = {
    *("rmse_m", "heldout_rmse_m", "check_rmse_m", "ceiling_heldout_rmse_m", "noise_m", "improvement", "placebo_p"),
    *("placebo_heldout_rmse_m", "confirmations", "noise_rmse_m"),
}
RANKED = {
    *("mechanism", "says", "physics", "log_evidence", "probability", "heldout_rmse_change", "detectability"),
    *("estimate", "where", "region", "rejected_because"),
}


@pytest.mark.parametrize("verdict", VERDICTS)
def test_keys_are_complete(small_diagnosis, verdict, tmp_path):
    said = describe(verdict_of(small_diagnosis, verdict), OPTIONS, "cpu")
    write_summary(tmp_path / "diagnosis.json", said)
    read = json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))
    assert set(read) == KEYS
    assert set(read["fit"]) == FIT
    assert all(set(one) == RANKED for one in read["ranking"])
    assert [one["mechanism"] for one in read["mechanisms"]] == (["gravity"] if verdict.startswith("named") else [])
    assert (read["mechanism"] == "gravity") == verdict.startswith("named")


def test_evidence_is_against_nothing_where_that_is_too_improbable_to_be_listed(small_diagnosis):
    told = describe(verdict_of(small_diagnosis, "named"), OPTIONS, "cpu")
    [nothing] = [one["log_evidence"] for one in told["hypotheses"] if not one["causes"]]
    listed = [one for one in told["hypotheses"] if one["causes"]]
    for hypotheses in (told["hypotheses"], listed):
        sets = shown_of(told | {"hypotheses": hypotheses})["sets"]
        expected = [f"{one['log_evidence'] - nothing:+.1f}" for one in hypotheses[: len(sets)]]
        assert [row[2] for row in sets] == expected


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_referee_reads_all_of_it(small_diagnosis, verdict, tmp_path):
    """What it scores by and calibrates from, key by key."""
    told = verdict_of(small_diagnosis, verdict)
    write_summary(tmp_path / "diagnosis.json", describe(told, OPTIONS, "cpu"))
    read = read_diagnosis(tmp_path / "diagnosis.json")
    assert (read.verdict, read.p_value, read.group) == (verdict, told.p_value, told.group)
    assert read.names == tuple(one.kind for one in told.named)
    assert read.spoken == bool(told.named)
    kinds = {Kind.UNKNOWN: "unknown", Kind.NOT_PHYSICS: "not physics"}
    for tried, one in zip(read.hypotheses, told.combinations, strict=True):
        assert tried.causes == {kinds.get(kind, name) for name, kind in zip(one.causes, one.kinds, strict=True)}
        assert (tried.log_density, tried.probability) == (one.log_evidence + one.log_prior, one.probability)
    ranked = {one.kind: one.probability for one in told.ranking}
    assert {row.name: row.probability for row in read.tried} == {n: ranked[n] for n in (r.name for r in read.tried)}
    assert {row.name for row in read.ranking if row.alternative} == {
        one.kind for one in told.ranking if not one.physics and one.kind != "unknown"
    }
    assert read.first == ("" if verdict == "nothing missing" else told.ranking[0].kind)
    assert set(read.heldout) == {"declared", "refitted"} | ({"explained"} if told.fit.explained else set())
    if told.named:
        assert {value.name for value in told.named[0].values} == set(read.parameters)


@pytest.mark.slow(4)
def test_what_was_not_tried_is_in_the_ranking(diagnosed):
    ranking = json.loads((diagnosed / "diagnosis.json").read_text(encoding="utf-8"))["ranking"]
    assert {"gravity", "pressure", "swelling", "falx", "unknown"} <= {one["mechanism"] for one in ranking}
    rejected = [one for one in ranking if one["log_evidence"] is None]
    assert rejected and all(one["rejected_because"] for one in rejected)


def test_the_docs_know_every_key():
    text = (Path(__file__).parents[3] / "docs" / "diagnosis.md").read_text(encoding="utf-8")
    for key in KEYS | FIT | RANKED:
        assert f"`{key}`" in text, key


def test_the_noise_is_a_distance_where_errors_are(small_diagnosis):
    """Against distances of drawn noise, in three directions of tracked points and along the normals of surfaces."""
    sensors = small_diagnosis.base.at.sensors
    noise = np.linspace(1e-4, 3e-4, len(sensors))
    drawn = noise * np.random.default_rng(3).standard_normal((4000, len(sensors)))
    rows = sensors.is_displacement
    squares = [(drawn[:, rows & (sensors.groups == point)] ** 2).sum(axis=1) for point in set(sensors.groups[rows])]
    assert distance(sensors, noise) == pytest.approx(np.sqrt(np.mean(squares)), rel=0.01)


def test_what_was_not_weighed_is_in_the_ranking_whatever_kind_it_is_of(small_diagnosis, tmp_path):
    """What is no physics, and the unknown, are no mechanisms with a sentence of their own."""
    kinds = {"drainage": True, "loads": False, "registration": False, "unknown": False}
    diagnosis = replace(small_diagnosis, rejected=dict.fromkeys(kinds, "nothing tells of it"))
    write_summary(tmp_path / "diagnosis.json", describe(diagnosis, OPTIONS, "cpu"))
    rows = json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))["ranking"][-len(kinds) :]
    assert {row["mechanism"]: row["physics"] for row in rows} == kinds
    assert all(row["says"].endswith(".") and set(row) == RANKED for row in rows)
    assert read_diagnosis(tmp_path / "diagnosis.json").verdict == diagnosis.verdict
