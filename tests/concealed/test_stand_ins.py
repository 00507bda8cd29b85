"""Every promise made about the observations that ship with the stand-ins."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from concealed.check import SAME, intact, main, remade
from concealed.observing import rms
from concealed.places import CASES, MESHES, ROOT, truth_file
from concealed.publish import read_recording
from concealed.published import NAMES
from concealed.sealing import open_sealed, read_sealed
from concealed.table import rows
from warpbrain.mesh import read_mesh
from warpbrain.recordings.location import locate

# Table 5 of the paper: nodes of ventricles and resection margin
COUNTS = {
    "0529": (263, 26),
    "0614": (196, 26),
    "0660": (198, 32),
    "0685": (164, 30),
    "0535": (174, 27),
    "0555": (140, 30),
    "0603": (169, 42),
    "0684": (137, 38),
}
WALLS = ("ventricles", "cavity")
PACKAGE = ROOT / "warpbrain"


def recording(name: str, wall: str):
    """Points and displacement [m]."""
    return read_recording(CASES / name / "recordings" / f"{wall}.csv")


def test_all_eight_are_there():
    assert set(NAMES) == set(COUNTS)


@pytest.mark.parametrize("name", COUNTS)
def test_as_many_points_as_were_published(name):
    for wall, count in zip(WALLS, COUNTS[name], strict=True):
        points, displacement = recording(name, wall)
        assert points.shape == displacement.shape == (count, 3)
        assert len(np.unique(points, axis=0)) == count


def test_motion_before_any_model_has_the_published_medians():
    motion = np.array([[rms(recording(name, wall)[1]) for wall in WALLS] for name in COUNTS])
    np.testing.assert_allclose(1e3 * np.median(motion, axis=0), (1.37, 5.89), rtol=0.007)
    # eight individuals, not one
    assert (motion.std(axis=0) > 0.1 * motion.mean(axis=0)).all()


@pytest.mark.parametrize("name", COUNTS)
@pytest.mark.parametrize("tissue", ["single", "multi"])
def test_every_point_is_in_the_mesh_or_beside_it(name, tissue):
    mesh = read_mesh(CASES / name / f"{tissue}.vtu", unit="mm")
    left, _, _ = mesh.without(mesh.element_sets["resection"])
    for wall, ours in zip(WALLS, ("ventricle", "resection"), strict=True):
        points, _ = recording(name, wall)
        place = locate(left.points, left.tetrahedra, points)
        assert (place.distance <= place.edge).all()
        # and by its own wall: nearer to one of its nodes than an edge is long, at most 8.2 mm
        nodes = left.points[left.node_sets[ours]]
        assert np.linalg.norm(points[:, None] - nodes[None], axis=2).min(axis=1).max() < 0.012


@pytest.mark.parametrize("name", COUNTS)
@pytest.mark.parametrize("file", ["case.toml", "case-single.toml"])
def test_what_is_declared(name, file):
    text = (CASES / name / file).read_text(encoding="utf-8")
    case = tomllib.loads(text)
    side = "Left" if np.mean(recording(name, "cavity")[0][:, 0]) < 0.0 else "Right"
    assert case["case"]["title"] == f"{side} temporal lobe resection, stand-in for clinical case {name}"
    assert (case["case"]["name"], case["case"]["origin"]) == (name, "stand-in")
    assert case["case"]["gravity_axis"] == [0, -1, 0]
    assert [mechanism["kind"] for mechanism in case["mechanism"]] == ["resection", "gravity"]
    assert 80.0 < case["mechanism"][1]["csf_level"] < 220.0
    assert [boundary["kind"] for boundary in case["boundary"]] == ["fixed"]
    assert [(entry["name"], entry["role"]) for entry in case["recording"]] == [(wall, "fit") for wall in WALLS]
    assert text.startswith(f"# Stand-in for clinical case {name}, not a patient")


@pytest.mark.parametrize("name", COUNTS)
def test_recordings_say_what_they_are(name):
    for wall in WALLS:
        lines = (CASES / name / "recordings" / f"{wall}.csv").read_text(encoding="utf-8").splitlines()
        assert lines[0].startswith(f"# stand-in for clinical case {name}, not a patient")
        assert lines[1] == "x,y,z,ux,uy,uz,id"


@pytest.mark.parametrize("name", COUNTS)
def test_the_truth_is_the_one_that_was_sealed(name):
    assert intact(name)


def test_the_check_says_so(capsys):
    assert main([]) == 0
    assert capsys.readouterr().out.count("the truth is the one whose hash was published") == len(COUNTS)


@pytest.mark.parametrize("name", COUNTS)
def test_a_truth_holds_what_is_needed_to_make_it_again(name):
    truth = open_sealed(read_sealed(truth_file(name)))
    keys = {"seed", "effects", "csf_level_m", "tissue", "law", "blur", "mesh", "observed", "versions", "limitations"}
    assert keys <= set(truth)
    # the noise-free motion of the very points that are published
    for wall in WALLS:
        np.testing.assert_allclose(recording(name, wall)[0], truth["observed"][wall]["point_m"], atol=6e-8)
    assert str(Path.home()) not in json.dumps(truth)


def test_the_package_neither_opens_nor_carries_a_truth():
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        assert "concealed" not in text and "truth.sha256" not in text, file
    assert not [file for file in PACKAGE.rglob("*") if file.name.endswith((".json.gz", ".json.xz"))]
    assert all(truth_file(name).is_relative_to(ROOT / "concealed") for name in NAMES)
    packaged = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    assert packaged["packages"]["find"]["include"] == ["warpbrain*"]


def test_reading_a_case_opens_no_truth():
    """Every file that is opened while a stand-in is read and made a model of, seen from Python itself."""
    code = f"""
import sys
opened = []
sys.addaudithook(lambda event, arguments: opened.append(str(arguments[0])) if event == "open" else None)
from warpbrain.cases.reading import read_case
from warpbrain.simulation.of_case import model_of
from pathlib import Path
for file in ("case.toml", "case-single.toml"):
    model_of(read_case(Path({str(CASES)!r}) / "0529" / file))
assert any(name.endswith("case.toml") for name in opened)
assert not [name for name in opened if "truth" in name or "concealed" in name]
assert not [name for name in sys.modules if name.startswith("concealed")]
"""
    seen = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120)
    assert seen.returncode == 0, seen.stderr


def test_the_page_says_what_is_published():
    page = (ROOT / "docs" / "stand-ins.md").read_text(encoding="utf-8")
    assert "\n".join(rows()) in page
    assert "No claim about any patient follows" in page.replace("\n", " ")


def test_fine_meshes_are_kept_outside_the_repository():
    assert not MESHES.is_relative_to(ROOT)
    assert not list((ROOT / "concealed").rglob("*.vtu"))


@pytest.mark.slow(80)
@pytest.mark.xdist_group("building")
def test_motion_can_be_found_again_from_a_truth(tmp_path):
    for package in ("mmgpy", "nilearn", "nibabel"):
        pytest.importorskip(package)
    from warpbrain.cases.building.pipeline import versions

    truth = ROOT / "bench" / "results" / "stand_ins_sealed_10" / "r20-0684.json.gz"
    # its motion was found on a GPU with other packages than its fine mesh was made with, which are those of this truth
    made_with = open_sealed(read_sealed(truth_file("0684")))["versions"]
    if any(made_with.get(package, found) != found for package, found in versions().items() if package != "machine"):
        pytest.skip(f"truths were made with {made_with}, here are {versions()}")
    assert remade(truth, tmp_path) < SAME
