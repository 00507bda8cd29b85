"""`warpbrain run` of a case with a specimen: what it prints, what it writes, and what it refuses."""

import csv
import json
import re
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from command import Ran, run
from folders import changed

from warpbrain.cases import specimen as specimens

CASE = """\
[case]
name = "disc"
title = "A disc of $gel"
origin = "synthetic"

[specimen]
shape = "cylinder"
radius = 4.0
height = 4.541
grips = "glued"

[tissue.1]
name = "gel"
mu = 1000.0

[[recording]]
name = "press"
kind = "test"
mode = "axial"
file = "press.csv"
sigma = 1e-4

[[recording]]
name = "slide"
kind = "test"
mode = "shear"
file = "slide.csv"
role = "check"

[[recording]]
name = "twist"
kind = "test"
mode = "torsion"
file = "twist.csv"
"""
TABLES = {
    "press.csv": "t,displacement,force\n0,0,0\n1,-0.2,-0.01\n2,-0.5,-0.03\n3,0.1,0.004\n",
    "slide.csv": "displacement,force\n0.0,0.0\n0.3,0.003\n",
    "twist.csv": "angle,torque\n0.0,0.0\n-0.2,-2e-5\n",
}
FILES = ["comparison.csv", "report.html", "summary.json", "tests.png", "warpbrain.log"]


@pytest.fixture(autouse=True, scope="module")
def coarse():
    """An eighth of the elements: what is looked at here does not depend on them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(specimens, "CELLS", 6)
        yield


def write(folder: Path, *changes: tuple[str, str], tables: dict[str, str] = TABLES) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "case.toml").write_text(changed(CASE, *changes), encoding="utf-8")
    for name, text in tables.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return write(tmp_path_factory.mktemp("disc"))


@pytest.fixture(scope="module")
def ran(folder, tmp_path_factory) -> tuple[Ran, Path]:
    out = tmp_path_factory.mktemp("out")
    return run(folder, "--out", out), out


def summary(out: Path) -> dict:
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))


def rows(out: Path) -> list[dict[str, str]]:
    with (out / "comparison.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_what_is_printed(ran):
    found, out = ran
    assert (found.status, found.err) == (0, "")
    lines = found.out.splitlines()
    assert lines[:2] == [
        "A disc of $gel",
        "  specimen  cylinder, radius 4 mm, height 4.541 mm, 0.228 cm3; ends glued",
    ]
    assert "  tissue 1  gel: neo-hookean (coupled), mu = 1000 Pa, nu = 0.45" in lines
    assert any(re.match(r"  mesh      \d+ nodes, \d+ tetrahedra$", line) for line in lines)
    # what it rests on and what it leaves out
    assert any(re.match(r"  assumed   both ends are glued ", line) for line in lines)
    assert any(re.match(r"  assumed   the tissue is elastic and the test quasi-static: ", line) for line in lines)
    assert any(re.match(r"  left out  rate and history: ", line) for line in lines)
    assert any(re.match(r"  left out  the linear tetrahedra make a glued specimen stiffer ", line) for line in lines)
    number = r" +-?\d\S*"
    for name, mode, count, role, unit in (
        ("press", "axial", 4, "fit", "N"),
        ("slide", "shear", 2, "check", "N"),
        ("twist", "torsion", 2, "fit", "N m"),
    ):
        row = rf"  {name} +{mode} +{count}  {role} +{number}{number}  {unit} +{number}{number}{number}{number}$"
        assert any(re.match(row, line) for line in lines), (row, lines)
    assert any(re.match(r"  solve system +\d+ +\d+\.\d\d +\d+\.\d$", line) for line in lines)
    assert lines[-1] == f"written to {out}: summary.json, comparison.csv, tests.png, report.html"
    assert sorted(path.name for path in out.iterdir()) == FILES


def test_the_report_is_one_file(ran):
    page = (ran[1] / "report.html").read_text(encoding="utf-8")
    assert not re.findall(r'(?:src|srcset|href)="(?!data:|#)', page) and not re.search(r">(nan|None|inf)<", page)
    assert "rate and history" in page and re.search(r"<td[^>]*>check</td>", page)


def test_summary(ran):
    assert summary(ran[1])["case"]["remarks"] == []
    _, out = ran
    said = summary(out)
    assert said["case"]["specimen"] == {
        "shape": "cylinder",
        "size_mm": [pytest.approx(8.0), pytest.approx(8.0), pytest.approx(4.541)],
        "grips": "glued",
    }
    tests = said["solution"]["tests"]
    assert [(test["name"], test["mode"], test["role"], test["rows"]) for test in tests] == [
        ("press", "axial", "fit", 4),
        ("slide", "shear", "check", 2),
        ("twist", "torsion", "fit", 2),
    ]
    press, slide, twist = tests
    assert (press["imposed"]["quantity"], press["imposed"]["unit"], press["response"]["unit"]) == (
        "displacement",
        "mm",
        "N",
    )
    # eight steps down to -0.5 mm, two steps up to 0.1 mm
    np.testing.assert_allclose(press["imposed"]["values"], [*np.linspace(-0.5, 0.0, 9), 0.05, 0.1], atol=1e-12)
    assert np.all(np.diff(press["response"]["values"]) > 0.0)
    assert slide["response"]["values"][0] == 0.0 and slide["response"]["values"][-1] > 0.0
    assert (twist["imposed"]["unit"], twist["response"]["unit"]) == ("rad", "N m")
    assert min(press["smallest_volume_ratio_J"]) > 0.0 and press["newton_iterations"][8] == 0
    compared = said["recordings"]["compared"]
    assert [(entry["unit"], entry["count"]) for entry in compared] == [("N", 4), ("N", 2), ("N m", 2)]
    assert compared[0]["noise_root_mean_square"] == 1e-4
    recorded = np.array([0.0, -0.01, -0.03, 0.004])
    assert compared[0]["before"]["root_mean_square"] == pytest.approx(np.sqrt(np.mean(recorded**2)))
    assert {"solution", "seconds_by_phase", "versions", "device"} <= set(said)


def test_rows(ran):
    _, out = ran
    found = rows(out)
    assert [(row["recording"], row["row"], row["t_s"]) for row in found[:5]] == [
        *(("press", str(k), str(k)) for k in range(4)),
        ("slide", "0", ""),
    ]
    assert [row["imposed"] for row in found] == ["0", "-0.2", "-0.5", "0.1", "0", "0.3", "0", "-0.2"]
    assert {(row["quantity"], row["imposed_unit"], row["unit"]) for row in found} == {
        ("displacement", "mm", "N"),
        ("angle", "rad", "N m"),
    }
    for row in found:
        recorded, computed, difference = (float(row[key]) for key in ("recorded", "computed", "difference"))
        assert difference == pytest.approx(recorded - computed, abs=1e-5 * max(abs(recorded), abs(computed)))
    squares = [float(row["difference"]) ** 2 for row in found[:4]]
    error = summary(out)["recordings"]["compared"][0]["after"]["root_mean_square"]
    assert np.sqrt(np.mean(squares)) == pytest.approx(error, rel=1e-4)


def test_picture(ran):
    _, out = ran
    picture = matplotlib.image.imread(out / "tests.png")[..., :3]
    height, width, _ = picture.shape
    assert width > 1000 and height > 400
    # recorded points of both roles and the simulated curve
    colours = np.round(255 * picture.reshape(-1, 3)).astype(int)
    for colour in ((0, 114, 178), (213, 94, 0), (0, 0, 0)):
        assert (np.abs(colours - colour).max(axis=1) < 40).sum() >= 10, colour


def test_arguments_change_the_law(folder, ran, tmp_path):
    """Forces are proportional to the shear modulus."""
    _, out = ran
    assert run(folder, "--mu", "2000", "--out", tmp_path / "a", "--quiet") == Ran(0, "", "")
    expected = 2.0 * np.array([float(row["computed"]) for row in rows(out)])
    found = np.array([float(row["computed"]) for row in rows(tmp_path / "a")])
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    other = run(folder, "--model", "ogden", "--poisson", "0.3", "--out", tmp_path / "b")
    assert other.status == 0
    assert "  tissue 1  gel: ogden (coupled), mu = 1000 Pa, nu = 0.3" in other.out.splitlines()


def test_lubricated_ends(tmp_path):
    """Stretch and stress of one homogeneous element."""
    tables = {"press.csv": "stretch,stress\n1.0,0\n0.8,-900\n1.2,500\n"}
    alone = CASE[CASE.index('\n[[recording]]\nname = "slide"') :]
    folder = write(tmp_path / "case", ('"glued"', '"lubricated"'), (alone, ""), ("sigma = 1e-4", ""), tables=tables)
    found = run(folder, "--out", tmp_path / "out")
    assert (found.status, found.err) == (0, "")
    lines = found.out.splitlines()
    assert "  mesh      one element: the state is homogeneous" in lines
    assert any(line.startswith("  assumed   both ends slide without friction ") for line in lines)
    assert "tetrahedra" not in found.out
    assert any(re.match(r"  press +axial +3  fit .*  Pa ", line) for line in lines)
    [test] = summary(tmp_path / "out")["solution"]["tests"]
    assert (test["imposed"]["quantity"], test["imposed"]["unit"], test["response"]["unit"]) == ("stretch", "", "Pa")
    assert test["imposed"]["values"][8] == 1.0 and test["response"]["values"][8] == 0.0


@pytest.mark.parametrize("arguments", [["--steps", "3"], ["--to-rest"]])
def test_motion_is_refused(folder, tmp_path, arguments):
    found = run(folder, "--out", tmp_path / "out", *arguments)
    assert (found.status, found.out) == (2, "")
    assert f"{arguments[0]}: {folder / 'case.toml'} has a [specimen], whose tests are quasi-static" in found.err
    assert not (tmp_path / "out").exists()


def test_what_is_of_positions_is_refused(folder, tmp_path):
    found = run(folder, "--legacy-rmse", "--out", tmp_path / "out")
    assert found.status == 2 and "--legacy-rmse: " in found.err and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([('"glued"', '"lubricated"')], "[[recording]] 'slide' mode 'shear': lubricated grips slide"),
        ([(CASE[CASE.index("[[recording]]") :], "")], "no [[recording]] of kind 'test': nothing is imposed"),
        ([("height = 4.541", "height = 0.4")], "'press': found a displacement of -0.5 mm, expected more than -0.4 mm"),
        ([("mu = 1000.0", 'mu = "prior"\nprior = "MRE/abnormal"')], "[tissue.1] prior: the generative model"),
    ],
)
def test_what_is_refused_is_named(tmp_path, changes, message):
    """Before anything is computed."""
    found = run(write(tmp_path / "case", *changes), "--out", tmp_path / "out")
    assert (found.status, found.out) == (2, "")
    assert message in found.err and found.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_one_tissue_is_that_of_its_own_file(folder):
    found = run(folder, "--tissue", "single")
    assert found.status == 2 and "case-single.toml" in found.err


def test_what_relaxes_is_followed_through_time(tmp_path):
    """Mechanisms of a case or of `--with`; what cannot act in a specimen, or lacks times, is told first."""
    alone = CASE[CASE.index('\n[[recording]]\nname = "slide"') :]
    folder = write(tmp_path / "case", (alone, ""))
    found = run(folder, "--with", "viscoelasticity:moduli=2,times=0.5", "--out", tmp_path / "out")
    assert (found.status, found.err) == (0, "")
    assert "  assumed   the test is quasi-static and follows its recorded times" in found.out
    assert "rate and history" not in found.out
    [test] = summary(tmp_path / "out")["solution"]["tests"]
    assert test["time_s"][0] == 0.0 and test["time_s"][-1] == 3.0
    assert len(test["time_s"]) == len(test["response"]["values"])
    slow = {"press.csv": "displacement,force\n0,0\n-0.2,-0.01\n"}
    slower = write(tmp_path / "slower", (alone, ""), tables=slow)
    for where, said, expected in (
        (slower, "viscoelasticity:moduli=2,times=0.5", "no column t"),
        (folder, "inclusion:ratio=2,centre=0/0/1,radius=1", "means nothing in a [specimen]"),
    ):
        found = run(where, "--with", said, "--out", tmp_path / "none")
        assert found.status == 2 and expected in found.err
        assert not (tmp_path / "none").exists()


def test_elements_that_do_not_lock_say_nothing_of_locking(folder, tmp_path):
    found = run(folder, "--elements", "tet4-averaged", "--out", tmp_path / "out")
    assert found.status == 0 and "linear tetrahedra" not in found.out
