"""`warpbrain view`: a page of any result, and a clear word where there is no display."""

import re

import numpy as np
import pytest
from command import run, warpbrain
from folders import write_folder

from warpbrain.errors import InputError
from warpbrain.report.body_sections import write_view_page
from warpbrain.report.files import read_state


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    assert run(write_folder(tmp_path_factory.mktemp("case")), "--out", out).status == 0
    return out


def test_a_page_of_a_result(result, tmp_path):
    ran = warpbrain("view", result, "--html", tmp_path / "view.html", "--exaggeration", "3")
    assert (ran.status, ran.out, ran.err) == (0, f"written: {tmp_path / 'view.html'}\n", "")
    ran = warpbrain("view", result, "--html", tmp_path / "view.html")
    assert ran.status == 2 and "view.html: is there already: --overwrite replaces it" in ran.err
    page = (tmp_path / "view.html").read_text(encoding="utf-8")
    assert not re.findall(r'(?:src|srcset|href)="(?!data:|#)', page) and '"exaggeration": 3.0' in page
    largest = 1000.0 * np.linalg.norm(read_state(result).u, axis=1).max()
    assert f"<dd>{largest:.3g} mm</dd>" in page


def test_uncertainty_and_trust_are_fields_of_it(result, tmp_path):
    state = read_state(result)
    known = np.linspace(0.0, 1e-4, len(state.u))
    state = type(state)(state.path, state.mesh, state.u, None, known, np.ones(len(known), dtype=np.int32))
    write_view_page(tmp_path / "view.html", state, None)
    page = (tmp_path / "view.html").read_text(encoding="utf-8")
    assert "standard deviation of the displacement [mm]" in page and '"name": "trust"' in page


def test_without_a_display(result, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    ran = warpbrain("view", result)
    assert ran.status == 2 and "no display here: --html FILE" in ran.err


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("nowhere",), "nowhere: no such file or folder"),
        ((".", "--exaggeration", "-1"), "--exaggeration -1: expected a number of at least 0"),
    ],
)
def test_what_is_refused(tmp_path, monkeypatch, arguments, why):
    monkeypatch.chdir(tmp_path)
    ran = warpbrain("view", *arguments, "--html", "view.html")
    assert ran.status == 2 and why in ran.err and not (tmp_path / "view.html").exists()


def test_a_folder_that_is_no_result(tmp_path):
    with pytest.raises(InputError, match="found none of"):
        read_state(tmp_path)
