"""Two results side by side: inputs, RMSE, displacement on the same mesh and on another one, tissue, verdicts."""

import json

import numpy as np
import pytest
from command import run, warpbrain
from folders import block, write_recorded
from shapes import box

from warpbrain.errors import InputError
from warpbrain.report.files import SavedState
from warpbrain.report.page import lines
from warpbrain.report.two_results import SavedResult, describe_two, difference, read_result

pytestmark = pytest.mark.usefixtures("undrawn")


def state(mesh, u, path="x"):
    return SavedState(path, mesh, np.asarray(u, dtype=float), None, None, None)


@pytest.fixture(scope="module")
def results(undrawn, tmp_path_factory):
    place = tmp_path_factory.mktemp("two")
    case = write_recorded(place / "case")
    for name, arguments in {"a": [], "again": [], "softer": ["--mu", "1=500"]}.items():
        ran = run(case, "--out", place / name, *arguments)
        assert ran.status == 0, ran.err
    return place


def test_the_same_run_twice_differs_in_nothing(results):
    said = describe_two(read_result(results / "a"), read_result(results / "again"))
    assert said["inputs_that_differ"] == {}
    assert said["displacement"]["largest_mm"] == 0.0
    assert said["rmse"]["beads"]["values"][0] == said["rmse"]["beads"]["values"][1] > 0.0
    assert "inputs that differ: none" in lines("compare.txt", "compare", said)


def test_another_tissue(results, tmp_path):
    ran = warpbrain("compare", results / "a", results / "softer", "--json", tmp_path / "c.json")
    assert (ran.status, ran.err) == (0, "")
    again = warpbrain("compare", results / "a", results / "softer", "--json", tmp_path / "c.json")
    assert again.status == 2 and "c.json: is there already" in again.err
    said = json.loads((tmp_path / "c.json").read_text())
    assert said["tissue"]["soft, shear modulus"] == {
        "unit": "Pa",
        "values": [1000.0, 500.0],
        "intervals_95": [None] * 2,
    }
    u, v = (read_result(results / name).state.u for name in ("a", "softer"))
    assert said["displacement"]["largest_mm"] == pytest.approx(1000.0 * np.linalg.norm(v - u, axis=1).max())
    assert "displacement, on the same mesh" in ran.out
    assert f"at most {said['displacement']['largest_mm']:.4g} mm" in ran.out


def test_an_affine_motion_is_the_same_on_any_mesh(verify):
    """Linear elements hold it exactly; the second body is larger, finer and has other nodes."""
    gradient = np.array([[0.1, 0.02, 0.0], [0.0, -0.1, 0.03], [0.01, 0.0, 0.05]])
    first, second = block(2), box((7, 5, 3), (0.04, 0.05, 0.06))
    step = np.array([1e-3, 0.0, 0.0])
    found = difference(state(first, first.points @ gradient.T), state(second, second.points @ gradient.T + step))
    assert (found["same_mesh"], found["outside"], found["nodes"]) == (False, 0, 27)
    off = max(abs(found["root_mean_square_mm"] - 1.0), abs(found["largest_mm"] - 1.0))
    verify("difference of two results on other meshes, affine motions 1 mm apart", "analytic", off, 1e-12, "mm")


def test_nodes_that_are_in_one_body_only_are_counted(tmp_path):
    first, second = box((4, 4, 4), (0.04, 0.04, 0.04)), box((4, 4, 4), (0.04, 0.04, 0.02))
    found = difference(state(first, 0.0 * first.points), state(second, 0.0 * second.points + [0.0, 2e-3, 0.0]))
    assert (found["nodes"], found["outside"]) == (75, 50)
    assert found["second_mm"] == pytest.approx(2.0)
    away = box((1, 1, 1), (0.01, 0.01, 0.01))
    far = type(away)(away.points + 1.0, away.tetrahedra)
    with pytest.raises(InputError, match="the bodies are nowhere in one place"):
        difference(state(first, 0.0 * first.points), state(far, 0.0 * far.points))


def test_verdicts_and_intervals_are_side_by_side(tmp_path):
    base = {"case": {"name": "x"}, "versions": {}}
    parameter = {"tissue": "grey matter", "name": "shear modulus", "unit": "Pa", "estimate": 700.0}
    estimate = base | {"parameters": [parameter | {"interval_95": [400.0, 1200.0]}], "predictions": []}
    diagnosis = base | {"verdict": "named", "sentence": "Gravity is missing.", "fit": {"rmse_m": {"declared": 0.002}}}
    first = SavedResult(tmp_path, "estimate", estimate, None)
    second = SavedResult(tmp_path, "diagnose", diagnosis, None)
    text = "\n".join(lines("compare.txt", "compare", describe_two(first, second)))
    assert "700 (400 to 1200)" in text
    assert "A  none: no diagnosis" in text and "B  named: Gravity is missing." in text
    assert "all fitted, declared" in text and "displacement" not in text


def test_folders_that_are_no_results(tmp_path):
    for make, expected in (
        (lambda: None, "no such folder"),
        (lambda: (tmp_path / "a").mkdir(), "found none of diagnosis.json, estimate.json, summary.json"),
        (lambda: (tmp_path / "a" / "summary.json").write_text("["), "summary.json: cannot be read"),
        (lambda: (tmp_path / "a" / "summary.json").write_text("[]"), "summary.json: is no summary of a result"),
        (
            lambda: (tmp_path / "a" / "summary.json").write_text('{"case": {"tissues": {"1": {}}}}'),
            "not as this version writes results: KeyError",
        ),
    ):
        make()
        ran = warpbrain("compare", tmp_path / "a", tmp_path / "a")
        assert ran.status == 2
        assert expected in ran.err and ran.err.count("\n") == 1
