"""`warpbrain gp`: what it prints, writes and refuses."""

import csv
import json
from functools import partial
from importlib.resources import files

import numpy as np
import pytest
from command import warpbrain

from warpbrain.gp.literature.studies import VARIANTS, read_studies
from warpbrain.gp.sampling import draw_laws, law_of_curve, moduli
from warpbrain.gp.trained import KINDS, read_model, trained

GREY, WHITE, BRAIN = (f"hyperelastic/{anatomy}" for anatomy in ("grey matter", "white matter", "brain"))
STUDY = '[[study]]\nname = "mine"\ngroup = "hyperelastic/brain"\nmu = 3000.0\n'


def rows_of(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_samples_are_the_draws_of_the_model(tmp_path):
    path = tmp_path / "laws.csv"
    done = warpbrain(
        "gp", "sample", "--group", GREY, WHITE, "-n", "5", "--model", "ogden", "--seed", "1", "--csv", path
    )
    assert (done.status, done.err) == (0, "")
    rows = rows_of(path)
    assert [row["draw"] for row in rows] == list("01234")
    for number, row in enumerate(rows):
        drawn = draw_laws(trained(), [GREY, WHITE], "ogden", number, 1)
        assert int(row["attempts"]) == 1 + len(drawn.rejected)
        for group, fitted in zip((GREY, WHITE), drawn.fits, strict=True):
            said = [float(row[f"{group}: {name}"]) for name in ("mu [Pa]", "alpha", "mu0 [Pa]", "rms of fit")]
            assert said == pytest.approx([*fitted.values, fitted.shear_modulus, fitted.rms], rel=1e-9)
    assert "unstable and redrawn: " in done.out


def test_unstable_draws_are_counted_with_their_reason(tmp_path):
    path = tmp_path / "laws.csv"
    done = warpbrain("gp", "sample", "--group", BRAIN, "-n", "60", "--model", "ogden", "--csv", path)
    rows = rows_of(path)
    redrawn = sum(int(row["attempts"]) - 1 for row in rows)
    assert redrawn > 0
    assert f"unstable and redrawn: {redrawn} of {60 + redrawn} attempts" in done.out
    assert "d2Psi/dl2 is not positive" in done.out
    assert all(bool(row["why attempts were redrawn"]) == (row["attempts"] != "1") for row in rows)


def test_a_sample_is_printed_where_no_file_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = warpbrain("gp", "sample", "--group", GREY, WHITE, "-n", "3")
    lines = done.out.splitlines()
    assert GREY in lines[0] and WHITE in lines[0]
    assert lines[1].split() == ["draw", "attempts", "mu", "[Pa]", "mu0", "[Pa]", "mu", "[Pa]", "mu0", "[Pa]"]
    moduli = draw_laws(trained(), [GREY, WHITE], "neo-hookean", 2).shear_moduli
    assert np.array(lines[4].split(), dtype=float)[[3, 5]] == pytest.approx(moduli, rel=1e-4)
    assert not any(tmp_path.iterdir())


def test_the_sweep_of_the_paper(tmp_path):
    path = tmp_path / "sweep.csv"
    process = ("--gp", "coregionalised", "--variant", "as_published")
    done = warpbrain("gp", "sample", "--group", GREY, WHITE, "--sweep", "17", *process, "--csv", path)
    assert (done.status, done.err) == (0, "")
    rows = rows_of(path)
    assert len(rows) == 289
    row = next(row for row in rows if (row[f"k of {GREY}"], row[f"k of {WHITE}"]) == ("-2", "0.5"))
    model = trained("coregionalised", "as_published")
    for group, k in ((GREY, -2.0), (WHITE, 0.5)):
        assert float(row[f"{group}: mu [Pa]"]) == pytest.approx(law_of_curve(model, group, k).shear_modulus, rel=1e-9)


@pytest.mark.slow(6)
def test_fit_adds_a_study_and_the_folder_is_a_model(tmp_path, monkeypatch):
    # the quantiles of a thousand draws say how much a study changed; that they are said needs few
    monkeypatch.setattr("warpbrain.cli.gp.moduli", partial(moduli, draws=60))
    added, out = tmp_path / "studies.toml", tmp_path / "model"
    added.write_text(STUDY, encoding="utf-8")
    done = warpbrain("gp", "fit", "--add", added, "--out", out)
    assert (done.status, done.err) == (0, "")
    for said in ("73 studies", "converged after", "condition", "with mine:", "before", "after", f"--gp {out}"):
        assert said in done.out
    model = read_model(out)
    assert model.studies[-1].name == "mine"
    stiffer = law_of_curve(model, BRAIN).shear_modulus
    assert stiffer > law_of_curve(trained(), BRAIN).shear_modulus
    done = warpbrain("gp", "sample", "--group", BRAIN, "--sweep", "3", "--gp", out)
    assert f"{stiffer:.5g}" in done.out


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("variant", VARIANTS)
def test_shipped_models_tell_the_command_that_made_them(kind, variant):
    path = files("warpbrain.gp") / "models" / f"{kind}-{variant}" / "model.json"
    training = json.loads(path.read_text(encoding="utf-8"))["training"]
    assert training["command"] == f"warpbrain gp fit --gp {kind} --variant {variant}"


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    out = tmp_path_factory.mktemp("shown")
    return out, warpbrain("gp", "show", "--group", BRAIN, "--draws", "40", "--out", out)


def test_show_prints_moduli_with_intervals(shown):
    out, done = shown
    assert (done.status, done.err) == (0, "")
    rows = rows_of(out / "moduli.csv")
    assert [(row["law"], float(row["k"])) for row in rows] == [
        (law, k) for law in ("neo-hookean", "mooney-rivlin", "ogden") for k in (-2.0, 0.0, 2.0)
    ]
    for row in rows:
        fitted = law_of_curve(trained(), BRAIN, float(row["k"]), row["law"])
        assert float(row["shear modulus [Pa]"]) == pytest.approx(fitted.shear_modulus, rel=1e-9)
        assert f"{fitted.shear_modulus:.4g}" in done.out
        low, middle, high = (float(row[name]) for name in ("2.5 % [Pa]", "median of draws [Pa]", "97.5 % [Pa]"))
        assert low < middle < high
    assert "40 draws each: their medians are known to" in done.out


def test_show_writes_pictures(shown):
    out, _ = shown
    for name in ("studies.png", "draws.png", "extrapolation.png"):
        assert (out / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("sample", "--group", "grey"),
            "group 'grey': the generative model 'hierarchical' (corrected) has seen no study",
        ),
        (("sample", "--group", BRAIN, BRAIN), "a group is given twice"),
        (("sample", "--group", BRAIN, "-n", "0"), "-n 0: expected a whole number of at least 1"),
        (("sample", "--group", BRAIN, "--seed", "-1"), "--seed -1: expected"),
        (("sample", "--group", BRAIN, "--sweep", "1"), "--sweep 1: expected a whole number of at least 2"),
        (("sample", "--group", BRAIN, "--sweep", "3", "--seed", "1"), "--seed 1: means nothing with --sweep"),
        (("sample", "--group", BRAIN, "--poisson", "0.5"), "--poisson 0.5: expected"),
        (("sample", "--group", BRAIN, "--csv", "no/such/folder.csv"), "cannot be written to: no such folder"),
        (("sample", "--group", BRAIN, "--gp", "nothing"), "nothing: no such generative model"),
        (("sample", "--group", BRAIN, "--gp", ".", "--variant", "corrected"), "--variant corrected: the model in ."),
        (("show", "--group", "grey"), "--group grey: the model has seen no study of it"),
        (("show", "--draws", "3"), "--draws 3: expected at least 40"),
        (("fit", "--climbs", "2"), "--climbs 2: means nothing with the hierarchical model"),
        (("fit", "--gp", "coregionalised", "--climbs", "0"), "--climbs 0: expected"),
        (("compare", "--only", "nothing like it"), "no model has this in its name"),
    ],
)
def test_bad_arguments(arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = warpbrain("gp", *arguments)
    assert done.status == 2
    assert done.err.count("\n") == 1 and said in done.err
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (STUDY.replace("3000.0", '"stiff"'), "mu"),
        (STUDY.replace("mu = 3000.0\n", ""), "mu: missing"),
        (STUDY.replace("hyperelastic/brain", "brains"), "brains"),
        ("[[study]\nname", "studies.toml"),
    ],
)
def test_a_corrupted_or_half_given_study_writes_nothing(text, said, tmp_path):
    added = tmp_path / "studies.toml"
    added.write_text(text, encoding="utf-8")
    done = warpbrain("gp", "fit", "--add", added, "--out", tmp_path / "model")
    assert done.status == 2 and said in done.err and str(added) in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["studies.toml"]


def test_a_folder_of_that_name_is_not_touched(tmp_path):
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "mine.txt").write_text("mine", encoding="utf-8")
    done = warpbrain("gp", "fit", "--out", tmp_path / "model")
    assert done.status == 2 and "not empty" in done.err
    assert [path.name for path in (tmp_path / "model").iterdir()] == ["mine.txt"]


def test_a_comparison_goes_on_where_it_was_interrupted(tmp_path, monkeypatch):
    few = list({study.paper: study for study in read_studies()}.values())[:6]
    monkeypatch.setattr("warpbrain.cli.gp.read_studies", lambda variant: few)
    path = tmp_path / "scores.csv"
    only = ("gp", "compare", "--leave", "study", "--csv", path, "--only")
    first = warpbrain(*only, "moduli only")
    assert (first.status, first.err) == (0, "")
    text = path.read_text(encoding="utf-8")
    again = warpbrain(*only, "moduli only")
    assert again.out == first.out and path.read_text(encoding="utf-8") == text
    assert "6 studies of" in first.out and "hierarchical, moduli only" in first.out
    path.write_text(text.replace("model,", "models,"), encoding="utf-8")
    assert warpbrain(*only, "moduli only").status == 2
