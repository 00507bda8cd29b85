"""Every bad argument ends in one clear line that names it and exit status 2, and never in a traceback."""

import os
import re
import subprocess
import sys

import pytest
from command import Ran, run, warpbrain
from folders import write_folder

from warpbrain import atomic

UNSTABLE = ("mu = 3000.0", 'model = "mooney-rivlin"\nC1 = -100.0\nC2 = 300.0')


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A case that is right."""
    return write_folder(tmp_path_factory.mktemp("case"))


def refusal(ran: Ran) -> str:
    """The one line of a refusal, without what every one begins with."""
    assert ran.status == 2
    assert ran.err.count("\n") == 1
    assert ran.err.startswith("warpbrain: error: ")
    return ran.err.removeprefix("warpbrain: error: ").rstrip("\n")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--mu", "0"], "--mu 0: the shear modulus must be a positive number [Pa]"),
        (["--mu", "-5"], "--mu -5: the shear modulus must be a positive number [Pa]"),
        (["--mu=-1e-3"], "--mu -1e-3: the shear modulus must be a positive number [Pa]"),
        (["--mu", "nan"], "--mu nan: the shear modulus must be a positive number [Pa]"),
        (["--mu", "inf"], "--mu inf: the shear modulus must be a positive number [Pa]"),
        (["--mu", "1e999"], "--mu 1e999: the shear modulus must be a positive number [Pa]"),
        (["--mu", "soft"], "--mu soft: expected a number [Pa] or LABEL=PA"),
        (["--mu", "900 Pa"], "--mu 900 Pa: expected a number [Pa] or LABEL=PA"),
        (["--mu", "1=0"], "--mu 1=0: the shear modulus must be a positive number [Pa]"),
        (["--mu", "1=nan"], "--mu 1=nan: the shear modulus must be a positive number [Pa]"),
        (["--mu", "1="], "--mu 1=: expected a number [Pa] or LABEL=PA"),
        (["--mu", "=900"], "--mu =900: expected a number [Pa] or LABEL=PA"),
        (["--mu", "grey=900"], "--mu grey=900: expected a number [Pa] or LABEL=PA"),
        (["--mu", "1.5=900"], "--mu 1.5=900: expected a number [Pa] or LABEL=PA"),
        (["--mu", "7=900"], "--mu 7=900: no tissue 7 in this case (it has 1 (soft), 2 (stiff))"),
        (["--mu", "900", "1=900"], "--mu 900 1=900: give one number for every tissue or LABEL=PA for some, not both"),
        (["--mu", "1=900", "900"], "--mu 1=900 900: give one number for every tissue or LABEL=PA for some, not both"),
        (["--mu", "900", "800"], "--mu 900 800: expected one number for every tissue, or LABEL=PA for each"),
        (["--mu", "1=900", "1=800"], "--mu 1=900 1=800: tissue 1 is given twice"),
        (["--model", "fung"], "model 'fung': expected one of neo-hookean, mooney-rivlin, ogden"),
        (["--poisson", "0.5"], "--poisson 0.5: expected a number in the open interval (-1, 0.5)"),
        (["--poisson", "-1"], "--poisson -1: expected a number in the open interval (-1, 0.5)"),
        (["--poisson", "nan"], "--poisson nan: expected a number in the open interval (-1, 0.5)"),
        (["--poisson", "7"], "--poisson 7: expected a number in the open interval (-1, 0.5)"),
        (["--steps", "0"], "--steps 0: expected a whole number of at least 1"),
        (["--steps", "-3"], "--steps -3: expected a whole number of at least 1"),
        (["--tolerance", "0"], "--tolerance 0: expected a number between 0 and 1"),
        (["--tolerance", "1"], "--tolerance 1: expected a number between 0 and 1"),
        (["--tolerance=-1e-8"], "--tolerance -1e-08: expected a number between 0 and 1"),
        (["--tolerance", "nan"], "--tolerance nan: expected a number between 0 and 1"),
        (["--device", "cuda:99"], "device 'cuda:99': not found on this machine (there are: cpu"),
        (["--device", "tpu"], "device 'tpu': not found on this machine (there are: cpu"),
        (["--device", ""], "device '': not found on this machine (there are: cpu"),
    ],
)
def test_arguments(folder, tmp_path, arguments, expected):
    out = tmp_path / "out"
    assert refusal(run(folder, "--out", out, *arguments)).startswith(expected)
    # nothing was begun
    assert not out.exists()


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["walk"],
        ["run"],
        ["run", "--case"],
        ["run", "--case", "0529", "--tissue", "triple"],
        ["run", "--case", "0529", "--precision", "half"],
        ["run", "--case", "0529", "--steps", "many"],
        ["run", "--case", "0529", "--steps", "1.5"],
        ["run", "--case", "0529", "--steps", "3", "--to-rest"],
        ["run", "--case", "0529", "--poisson", "high"],
        ["run", "--case", "0529", "--tolerance", "small"],
        ["run", "--case", "0529", "--mu"],
        ["run", "--case", "0529", "--nonsense"],
        ["run", "--case", "0529", "extra"],
        ["cases", "paint"],
        ["cases", "build"],
    ],
)
def test_usage(arguments):
    ran = warpbrain(*arguments)
    assert ran.status == 2
    assert ran.out == ""
    assert ran.err.count("\n") == 1
    assert re.match(r"warpbrain[ a-z]*: error: .*\(see warpbrain[ a-z]* --help\)$", ran.err)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("0528", "did you mean '0529'?"),
        ("phantom_fine", "did you mean 'phantom-fine'?"),
        ("brain", "there are: 0529, "),
    ],
)
def test_unknown_case(name, hint):
    assert refusal(run(name)).startswith(f"case '{name}': no such case and no such folder ({hint}")


def test_unknown_case_to_build(tmp_path):
    assert "nobody" in refusal(warpbrain("cases", "build", "nobody", "--out", tmp_path))


def test_a_folder_without_a_case(tmp_path):
    assert refusal(run(tmp_path)) == f"{tmp_path}/case.toml: no such file"


def test_single_tissue_of_a_folder_that_has_none(folder):
    assert refusal(run(folder, "--tissue", "single")) == f"{folder}/case-single.toml: no such file"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("poisson = 0.45", "poisson = nan"), "[body] poisson: expected a finite number, found nan"),
        (("-0.05]", "nan]"), "[boundary 2] total: expected 3 finite numbers [N], found [0.01, 0.02, nan]"),
        (("poisson", "poison"), "[body] poison: unknown key (did you mean 'poisson'?)"),
        (('"mesh.vtu"', '"../../mesh.vtu"'), "[mesh] file: '../../mesh.vtu' leaves the case folder"),
        (('"top"', '"nobody"'), "[boundary 2] nodes: node set 'nobody' is empty"),
        (('"fixed"', '"contact"'), "[boundary 1] surface: missing (expected the name of a file in this folder)"),
    ],
)
def test_a_case_that_is_wrong(tmp_path, change, expected):
    write_folder(tmp_path, change)
    assert refusal(run(tmp_path)) == f"{tmp_path}/case.toml: {expected}"


def test_a_file_that_is_no_mesh(tmp_path):
    write_folder(tmp_path)
    (tmp_path / "mesh.vtu").write_bytes(b"")
    ran = run(tmp_path)
    assert refusal(ran).startswith(f"{tmp_path}/mesh.vtu: not a mesh that meshio can read")
    assert ran.out == ""


@pytest.mark.parametrize("name", ["afile", "afile/below"])
def test_out_that_cannot_be_a_folder(folder, tmp_path, name):
    (tmp_path / "afile").write_text("mine")
    out = tmp_path / name
    assert refusal(run(folder, "--out", out)).startswith(f"{out}: cannot be made a folder for output")
    assert (tmp_path / "afile").read_text() == "mine"


def test_out_that_cannot_be_written_is_known_before_anything_is_computed(folder, tmp_path, monkeypatch):
    # root may write anywhere, and tests often run as root: the answer of the system is stood in for
    monkeypatch.setattr(atomic.os, "access", lambda path, mode: False)
    ran = run(folder, "--out", tmp_path)
    assert refusal(ran) == f"{tmp_path}: cannot be written to"
    assert "Newton" not in ran.out


def test_a_law_that_is_unstable(tmp_path):
    write_folder(tmp_path, UNSTABLE)
    line = refusal(run(tmp_path, "--out", tmp_path / "out"))
    assert line.startswith(f"{tmp_path}/case.toml: [tissue.2] MooneyRivlin(C1=-100.0, C2=300.0) is unstable in tension")
    assert line.endswith("--allow-unstable computes with it all the same")
    ran = run(tmp_path, "--allow-unstable", "--out", tmp_path / "out")
    assert (ran.status, ran.err) == (0, "")


def test_a_body_that_nothing_holds(tmp_path):
    write_folder(tmp_path, ('[[boundary]]\nname = "table"\nnodes = "bottom"\nkind = "fixed"\n', ""))
    for arguments in ([], ["--to-rest"]):
        assert "is not held" in refusal(run(tmp_path, "--out", tmp_path / "out", *arguments))
    # it can fly
    assert run(tmp_path, "--out", tmp_path / "out", "--steps", "2").status == 0


def test_what_is_of_specimens_is_refused_of_a_body(folder, tmp_path):
    ran = warpbrain("diagnose", "--case", folder, "--homogeneous", "--out", tmp_path / "out")
    assert refusal(ran) == f"--homogeneous: {folder / 'case.toml'} has no [specimen]"
    assert not (tmp_path / "out").exists()


def test_a_step_of_a_motion_that_is_not_followed(folder):
    for arguments in ([], ["--steps", "3"]):
        ran = run(folder, "--time-step", "0.01", *arguments)
        assert refusal(ran) == "--time-step 0.01: means nothing without --to-rest"


def test_the_whole_program_says_one_line(tmp_path):
    """As the shell sees it, with the native libraries and the interpreter's end."""
    write_folder(tmp_path)
    command = [sys.executable, "-m", "warpbrain", "run", "--case", str(tmp_path), "--device", "cuda:99"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("warpbrain: error: device 'cuda:99': not found on this machine")
    assert sorted(os.listdir(tmp_path)) == ["case.toml", "mesh.vtu"]


def test_names_with_any_characters_are_only_shown(tmp_path, monkeypatch):
    """Free text of the case becomes neither a path nor a formula."""
    write_folder(
        tmp_path / "case",
        ('"block"', '"../a b/c"'),
        ("A block of gel", r"50 % of $\\foo$ in 脳"),
        ('"soft"', r'"$\\alpha_"'),
    )
    monkeypatch.chdir(tmp_path)
    ran = run(tmp_path / "case")
    assert (ran.status, ran.err) == (0, "")
    assert sorted(os.listdir(tmp_path)) == ["case", "warpbrain-..-a-b-c-multi"]
    assert "written to warpbrain-..-a-b-c-multi" in ran.out


def test_results_are_overwritten_only_if_that_is_asked_for(folder, tmp_path):
    out = tmp_path / "out"
    assert run(folder, "--out", out).status == 0
    before = (out / "summary.json").read_bytes()
    assert refusal(run(folder, "--out", out)) == f"{out}: has results already (summary.json): --overwrite replaces them"
    assert (out / "summary.json").read_bytes() == before
    assert run(folder, "--out", out, "--overwrite").status == 0
    assert (out / "summary.json").read_bytes() != before


def test_the_same_command_twice_writes_two_folders(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for expected in ("warpbrain-block-multi", "warpbrain-block-multi-2"):
        ran = run(folder)
        assert (ran.status, ran.err) == (0, "")
        assert f"written to {expected}: " in ran.out
    assert sorted(os.listdir(tmp_path)) == ["warpbrain-block-multi", "warpbrain-block-multi-2"]
