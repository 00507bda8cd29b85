"""`warpbrain run` with laws of the generative model: `--sample`, `--seed`, `--gp` and `mu = "prior"`."""

import hashlib
import json
import re

import pytest
from command import run
from folders import write_folder

from warpbrain.gp.sampling import draw_laws, law_of_curve
from warpbrain.gp.trained import trained, write_model

GREY, WHITE, BRAIN = (f"hyperelastic/{anatomy}" for anatomy in ("grey matter", "white matter", "brain"))
SOFT = ("mu = 1000.0", f'mu = 1000.0\nprior = "{GREY}"')
STIFF = ("mu = 3000.0", f'mu = 3000.0\nprior = "{WHITE}"')


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    # of a force that every draw can carry
    force = ("total = [0.01, 0.02, -0.05]", "total = [0.001, 0.002, -0.005]")
    return write_folder(tmp_path_factory.mktemp("block"), SOFT, STIFF, force)


def summary(out):
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("law", ["neo-hookean", "mooney-rivlin", "ogden"])
def test_a_draw_is_printed_written_and_the_same_twice(folder, tmp_path, law):
    runs = []
    for name in ("one", "two"):
        done = run(folder, "--sample", "7", "--model", law, "--out", tmp_path / name)
        assert (done.status, done.err) == (0, "")
        runs.append((done.out.splitlines(), summary(tmp_path / name)))
    (lines, said), (_, again) = runs
    assert said["prior"] == again["prior"] and said["result"] == again["result"]
    drawn = draw_laws(trained(), [GREY, WHITE], law, 7)
    assert said["prior"]["model"] == "hierarchical" and said["prior"]["variant"] == "corrected"
    draw = said["prior"]["draw"]
    assert (draw["sample"], draw["seed"], draw["redrawn"]) == (7, 0, len(drawn.rejected))
    assert draw["reasons"] == list(drawn.rejected)
    by = "by the generative model hierarchical (corrected)"
    assert f"  prior     draw 7 of seed 0 {by}; unstable and redrawn: {len(drawn.rejected)}" in lines
    for label, group, modulus in zip("12", (GREY, WHITE), drawn.shear_moduli, strict=True):
        assert said["prior"]["tissues"][label]["group"] == group
        assert said["prior"]["tissues"][label]["shear_modulus_Pa"] == pytest.approx(modulus)
        assert said["case"]["tissues"][label]["law"] == law
        assert said["case"]["tissues"][label]["shear_modulus_Pa"] == pytest.approx(modulus)
        line = next(line for line in lines if line.startswith(f"  tissue {label}  {group}, drawn: {law}, "))
        assert line.endswith(f", shear modulus {modulus:.6g} Pa")
    exponent = next(line for line in lines if ", drawn: " in line)
    assert bool(re.search(r"mu = -?[\d.]+ Pa, alpha = -?[\d.]+, shear", exponent)) == (law == "ogden")


def test_seed_and_model_choose_another_draw(folder, tmp_path):
    moduli = set()
    for arguments in ([], ["--seed", "1"], ["--gp", "coregionalised"]):
        done = run(folder, "--sample", "0", "--out", tmp_path / "out", "--overwrite", *arguments)
        assert done.status == 0, done.err
        said = summary(tmp_path / "out")
        moduli.add(said["case"]["tissues"]["1"]["shear_modulus_Pa"])
    assert said["prior"]["model"] == "coregionalised" and len(moduli) == 3


def test_a_model_of_the_users_is_an_input(folder, tmp_path):
    model = tmp_path / "mine"
    model.mkdir()
    write_model(model, trained(), {})
    done = run(folder, "--sample", "0", "--gp", model, "--out", tmp_path / "out")
    assert done.status == 0, done.err
    assert f"by the generative model hierarchical (corrected) of {model};" in done.out
    said = summary(tmp_path / "out")
    digest = hashlib.sha256((model / "model.json").read_bytes()).hexdigest()
    assert said["prior"]["folder"] == str(model)
    assert said["inputs_sha256"]["generative model, model.json"] == digest


def test_a_draw_that_was_redrawn_says_why(folder, tmp_path):
    number = next(n for n in range(100) if draw_laws(trained(), [GREY, WHITE], "ogden", n).rejected)
    done = run(folder, "--sample", str(number), "--model", "ogden", "--out", tmp_path / "out")
    assert done.status == 0, done.err
    assert "; unstable and redrawn: 1" in done.out
    assert re.search(r"^  redrawn   hyperelastic/(grey|white) matter: Ogden\(.*unstable", done.out, re.MULTILINE)


def test_the_prior_of_a_tissue_is_its_middle_curve(tmp_path):
    folder = write_folder(tmp_path / "case", ("mu = 1000.0", f'mu = "prior"\nprior = "{GREY}"'))
    done = run(folder, "--out", tmp_path / "out")
    assert done.status == 0, done.err
    mu = law_of_curve(trained(), GREY).shear_modulus
    middle = f"{GREY}, the middle curve of the generative model hierarchical (corrected)"
    line = f"  tissue 1  {middle}: neo-hookean, mu = {mu:.6g} Pa, shear modulus {mu:.6g} Pa"
    assert [said for said in done.out.splitlines() if "generative" in said] == [line]
    prior = summary(tmp_path / "out")["prior"]
    assert prior["draw"] is None and list(prior["tissues"]) == ["1"]
    # with a modulus of its own the generative model is not asked
    done = run(folder, "--mu", "1=900", "--out", tmp_path / "out", "--overwrite")
    assert "generative" not in done.out and "prior" not in summary(tmp_path / "out")


def test_a_specimen_is_of_a_drawn_law(tmp_path):
    (tmp_path / "press.csv").write_text("displacement,force\n0,0\n-0.2,-0.01\n")
    (tmp_path / "case.toml").write_text(f"""\
[case]
name = "disc"
origin = "synthetic"

[specimen]
shape = "cylinder"
radius = 4.0
height = 4.541
grips = "lubricated"

[tissue.1]
mu = "prior"
prior = "{BRAIN}"

[[recording]]
name = "press"
kind = "test"
mode = "axial"
file = "press.csv"
""")
    done = run(tmp_path, "--sample", "2", "--out", tmp_path / "out")
    assert done.status == 0, done.err
    assert "draw 2 of seed 0" in done.out
    expected = draw_laws(trained(), [BRAIN], "neo-hookean", 2).shear_moduli[0]
    assert summary(tmp_path / "out")["prior"]["tissues"]["1"]["shear_modulus_Pa"] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--sample", "-1"], "--sample -1: expected a whole number of at least 0"),
        (["--sample", "1", "--seed", "-1"], "--seed -1: expected a whole number of at least 0"),
        (["--sample", "1", "--mu", "1=900"], "--sample 1: gives every law; --mu 1=900 means nothing with it"),
        (["--seed", "1"], "--seed 1: means nothing without --sample"),
        (["--gp", "hierarchical"], '--gp hierarchical: means nothing without --sample or a tissue of mu = "prior"'),
        (["--sample", "1", "--gp", "nowhere"], "nowhere: no such generative model"),
    ],
)
def test_what_means_nothing_is_refused(folder, tmp_path, arguments, message):
    done = run(folder, "--out", tmp_path / "out", *arguments)
    assert (done.status, done.out) == (2, "")
    assert message in done.err and done.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_tissue_without_a_group_has_no_draw(tmp_path):
    done = run(write_folder(tmp_path / "case", SOFT), "--sample", "1", "--out", tmp_path / "out")
    assert done.status == 2
    assert "case.toml: [tissue.2] prior: missing, but a draw is of a group" in done.err
