"""`warpbrain estimate`: from a case folder to tables, files and figures."""

import json
import re
from dataclasses import replace
from functools import partialmethod

import numpy as np
import pytest
from command import Ran, warpbrain
from synthetic import GREY, WHITE, beads, block, truth

from warpbrain.cases.writing import write_case
from warpbrain.estimation.options import EstimationOptions
from warpbrain.mesh.refinement import refined
from warpbrain.report.files import SEEN, UNSEEN, read_state

QUICK = ("--samples", "25", "--no-causes")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A pushed block of two tissues with points to fit and points to check, of smaller elements than the case has."""
    case = block({"grey": GREY, "white": WHITE}, "pushed")
    result = truth(replace(case, mesh=refined(case.mesh)[0]))
    fit = replace(beads(result, count=60, noise=1e-4), file="recordings/beads.csv")
    check = replace(beads(result, seed=1, noise=1e-4), name="check", role="check", file="recordings/check.csv")
    path = tmp_path_factory.mktemp("cases") / "block"
    write_case(path, replace(case, recordings=(fit, check)))
    return path


def estimate(*arguments) -> Ran:
    return warpbrain("estimate", "--device", "cpu", "--case", *arguments)


@pytest.fixture
def short_chain(monkeypatch):
    """Where Laplace's approximation fails: what is looked at is what is written, not the last digit of it."""
    monkeypatch.setattr(EstimationOptions, "__init__", partialmethod(EstimationOptions.__init__, chain=25))


@pytest.mark.slow(14)
@pytest.mark.usefixtures("drawn", "short_chain")
def test_tables_files_and_figures(folder, tmp_path):
    out = tmp_path / "out"
    done = estimate(folder, "--out", out, "--samples", "25", "--registration", "0.5", "0.5")
    assert (done.status, done.err) == (0, "")
    for words in ("The recordings inform", "shear modulus", "Pareto k", "error of the mesh", "registration: shifted"):
        assert words in done.out
    assert re.search(r"beads +60 .* mm\n +check +40 .* mm, check", done.out)
    said = json.loads((out / "estimate.json").read_text(encoding="utf-8"))
    for one, modulus in zip(said["parameters"], (1370.0, 1000.0), strict=True):
        assert one["unit"] == "Pa" and one["name"] == "shear modulus"
        low, high = one["interval_95"]
        assert low < one["estimate"] < high and 0.5 * modulus < low < high < 2.0 * modulus
        assert 0.0 < one["shrinkage"] < 1.0 and one["prior"]["interval_95"][0] < low
    assert np.shape(said["correlation"]["matrix"]) == (2, 2)
    assert said["check_of_laplace"]["draws"] == 25 and said["check_of_laplace"]["pareto_k"] is not None
    assert [(p["name"], p["role"]) for p in said["predictions"]] == [("beads", "fit"), ("check", "check")]
    assert all(p["root_mean_square_after"] < p["root_mean_square_before"] for p in said["predictions"])
    assert all(0.8 < p["coverage"]["95 %"] <= 1.0 for p in said["predictions"])
    assert said["discretisation"]["difference_root_mean_square_mm"] > 0.0
    assert len(said["registration"]["shift_mm"]) == 3
    assert set(said["inputs_sha256"]) == {"case.toml", "mesh.vtu", "recordings/beads.csv", "recordings/check.csv"}
    assert said["likelihood"]["degrees_of_freedom"] is None and 0.6 < said["likelihood"]["noise_scale"] < 1.6
    for one, together in zip(said["predictions"], said["all_recordings"], strict=True):
        assert together["role"] == one["role"] and together["count"] == one["count"]
        for key in ("before", "after", "of_run"):
            assert together[f"root_mean_square_{key}_mm"] == pytest.approx(one[f"root_mean_square_{key}"])
    nothing_else_acts(done.out, said)
    assert said["seed"] == 0
    assert said["versions"]["warpbrain"] and said["seconds"] and said["equilibria"]["check of the posterior"] == 25
    rows = (out / "predictions.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + 60 + 40
    state = read_state(out)
    assert 0.0 < state.deviation.max() < np.linalg.norm(state.u, axis=1).max()
    # nothing is left where nothing else acts; beads are inside, and a force on the base that is held moves none
    assert set(np.unique(state.trust)) == {SEEN, UNSEEN}
    for picture in ("posterior.png", "predicted.png", "residuals.png", "deformation.png"):
        assert (out / picture).stat().st_size > 5000
    page = (out / "report.html").read_text(encoding="utf-8")
    assert not re.findall(r'(?:src|srcset|href)="(?!data:|#)', page) and not re.search(r">(nan|None|inf)<", page)
    assert re.findall(r"<h2>(.*?)</h2>", page)[:5] == [
        "Tissue",
        "What else may act",
        "What was recorded",
        "Before and after",
        "How well the displacement is known",
    ]
    assert (
        re.search(r"<dt>grey, shear modulus</dt><dd>[\d.]+ Pa \(", page) and "Hatched: recordings see nothing" in page
    )


def nothing_else_acts(printed, said):
    """Of the sets of causes none is the most probable, and tissue is much as it is without any."""
    assert (
        re.search(r"probability that nothing acts but what the case says: \d+ %\n", printed)
        and "tissue averaged" not in printed
    )
    sets = said["nothing_else"]
    assert {"pressure", "traction", "registration", "unknown"} <= {one["name"] for one in sets["causes"]}
    assert sets["probability"] > 2.0 * max(one["probability"] for one in sets["causes"])
    for alone, averaged in zip(said["parameters"], sets["tissue"], strict=True):
        assert (averaged["tissue"], averaged["unit"]) == (alone["tissue"], "Pa")
        low, high = averaged["interval_95"]
        assert low < alone["estimate"] < high and low < averaged["middle"] < high


@pytest.mark.slow(4)
def test_too_few_points_to_know_what_else_may_act(tmp_path):
    case = block({"brain": WHITE}, "pushed")
    recording = replace(beads(truth(case), count=4, noise=1e-4), file="b.csv")
    write_case(tmp_path / "block", replace(case, recordings=(recording,)))
    out = tmp_path / "out"
    done = estimate(tmp_path / "block", "--out", out, *QUICK, "--no-discretisation", "--causes")
    assert (done.status, done.err) == (0, "") and "shear modulus" in done.out
    assert "what else may act is not known: " in done.out and "too few for any conclusion" in done.out
    assert json.loads((out / "estimate.json").read_text(encoding="utf-8"))["nothing_else"] is None


@pytest.mark.slow(6)
@pytest.mark.usefixtures("drawn")
def test_a_sweep_goes_on_where_it_was_interrupted(folder, tmp_path):
    out = tmp_path / "out"
    done = estimate(folder, "--method", "grid", "--out", out)
    assert (done.status, done.err) == (0, "")
    assert "least error of 289 equilibria: RMSE " in done.out
    table = (out / "sweep.csv").read_text(encoding="utf-8")
    assert len(table.splitlines()) == 290 and (out / "sweep.png").stat().st_size > 5000
    lines = table.splitlines(keepends=True)
    (out / "sweep.csv").write_text("".join(lines[:280]), encoding="utf-8")
    again = estimate(folder, "--method", "grid", "--out", out)
    assert again.status == 0 and "279 of which are there already" in again.out
    assert again.out.splitlines()[-4:-2] == done.out.splitlines()[-4:-2]
    other = estimate(folder, "--method", "grid", "--out", out, "--gp", "hierarchical")
    assert other.status == 2 and "a sweep of something else" in other.err


def test_quiet_says_nothing(folder, tmp_path):
    done = estimate(folder, "--out", tmp_path / "out", *QUICK, "--no-discretisation", "--quiet")
    assert (done.status, done.out, done.err) == (0, "", "")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--registration", "0", "1"), "expected two positive numbers"),
        (("--nu", "-1"), "expected a positive number of degrees of freedom"),
        (("--registration", "1", "1", "--no-registration"), "not allowed with argument --registration"),
        (("--method", "grid", "--nu", "4"), "--nu: means nothing with --method grid"),
        (("--method", "grid", "--no-discretisation"), "--no-discretisation: means nothing with --method grid"),
        (("--method", "grid", "--seed", "0"), "--seed: means nothing with --method grid"),
        (("--method", "grid", "--causes"), "--causes: means nothing with --method grid"),
        (("--samples", "3"), "--samples 3: expected a whole number of at least 25"),
        (("--gp", "nonsense"), "no such generative model"),
        (("--model", "rubber"), "expected one of"),
        (("--device", "toaster"), "not found on this machine"),
    ],
)
def test_bad_arguments(folder, tmp_path, arguments, message):
    done = estimate(folder, "--out", tmp_path / "out", *arguments)
    assert done.status == 2 and message in done.err and "Traceback" not in done.err


def test_a_case_without_recordings(tmp_path):
    done = estimate("phantom", "--out", tmp_path / "out")
    assert done.status == 2 and "no [[recording]] to estimate from" in done.err


@pytest.mark.slow(5)
def test_gross_errors_only(tmp_path):
    case = block({"brain": WHITE}, "pushed")
    recording = beads(truth(case), count=60)
    noise = 0.01 * np.random.default_rng(3).normal(size=(60, 3))
    write_case(tmp_path / "block", replace(case, recordings=(replace(recording, displacement=noise, file="b.csv"),)))
    done = estimate(tmp_path / "block", "--out", tmp_path / "out", *QUICK)
    assert done.status == 1 and "are gross errors" in done.err
    assert not (tmp_path / "out").exists()
