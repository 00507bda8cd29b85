"""The page of a diagnosis: one file, complete for every verdict, and for what has no mesh."""

import base64
import csv
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from testing_machine import case_of, recorded

from warpbrain.cases.specimen import Specimen
from warpbrain.errors import InputError
from warpbrain.inference.decide import VERDICTS
from warpbrain.report.diagnosis.html import page_of, write_page
from warpbrain.report.diagnosis.saved import read_saved
from warpbrain.report.diagnosis.specimen import describe_specimen_diagnosis, write_curves
from warpbrain.report.files import write_summary
from warpbrain.worlds.specimen.diagnose import DiagnosingSpecimen, SpecimenOptions


@pytest.fixture
def folder(diagnosed, tmp_path):
    shutil.copytree(diagnosed, tmp_path / "copy")
    return tmp_path / "copy"


def change(folder, **keys):
    path = folder / "diagnosis.json"
    said = json.loads(path.read_text(encoding="utf-8"))
    said.update(keys)
    path.write_text(json.dumps(said), encoding="utf-8")
    return said


def test_it_is_one_file_without_a_network(diagnosed):
    page = (diagnosed / "report.html").read_text(encoding="utf-8")
    assert len(page) < 6e6
    assert not re.findall(r'(?:src|srcset|href)="(?!data:|#)', page)
    assert "http://" not in page and "https://" not in page and "url(" not in page and "@import" not in page


def test_the_verdict_is_on_top(diagnosed):
    page = (diagnosed / "report.html").read_text(encoding="utf-8")
    body = page[page.index("<main>") :]
    for words in ("any smooth force without a name", "patterns that mean nothing", "what noise alone leaves"):
        assert words in body
    places = [body.index(text) for text in ('class="badge">named<', "Before and after", "In three dimensions")]
    assert places == sorted(places)
    headings = re.findall(r"<h2>(.*?)</h2>", body)
    assert headings == [
        *("Before and after", "In three dimensions", "Candidates", "Where"),
        *("How well the displacement is known", "What cannot be told apart"),
        *("What to measure next", "What these data would have shown", "What was assumed"),
    ]


def test_every_picture_says_what_it_shows(diagnosed):
    page = (diagnosed / "report.html").read_text(encoding="utf-8")
    alternatives = re.findall(r'<img src="data:image/png;base64,[^"]*" width="\d+" alt="([^"]*)"', page)
    assert len(alternatives) == page.count("<img") == 5 and all(len(text) > 20 for text in alternatives)


@pytest.mark.parametrize("verdict", [v for v in VERDICTS if v != "named"])
def test_every_verdict_has_a_page(folder, verdict):
    said = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    fit = {**said["fit"], "improvement": None, "placebo_p": None, "placebo_heldout_rmse_m": None}
    for key in ("rmse_m", "heldout_rmse_m"):
        fit[key] = {**fit[key], "explained": None}
    group = ["gravity", "swelling"] if verdict == "group" else []
    # pictures are the same for all: without anatomy and points the words are left
    for name in ("map.vtu", "points.csv"):
        (folder / name).unlink()
    change(folder, verdict=verdict, mechanism=None, where=None, group=group, fit=fit, next_measurement=[])
    page = page_of(read_saved(folder))
    assert f'class="badge">{verdict}<' in page
    body = re.sub(r"base64,[^\"]*", "", page[page.index("<main>") :])
    assert "<canvas" not in body and not re.search(r"\b(nan|None|inf)\b", body)


def test_a_specimen_has_curves_in_the_place_of_an_anatomy(folder):
    for name in ("map.vtu", "points.csv"):
        (folder / name).unlink()
    fit = {
        "rmse_pa": {"declared": 900.0, "refitted": 400.0, "explained": 60.0},
        "heldout_rmse_pa": {"declared": None, "refitted": 450.0, "explained": 70.0},
        "check_rmse_pa": {"declared": {"pull": 80.0}, "refitted": {"pull": 70.0}, "explained": {"pull": 20.0}},
        "held_out": "each test in turn",
        "improvement": {"part": 0.8, "interval_95": [0.7, 0.9]},
        "confirmations": [{"mechanism": "fibres", "log_evidence": 9.0, "heldout_gain": {"part": 0.8,
                           "interval_95": [0.7, 0.9]}, "placebo_p": 0.01, "why_not": ""}],
    }  # fmt: skip
    where = {"test": "press", "mode": "compression", "segment": "loading", "strain": [0.8, 0.9]}
    said = change(folder, fit=fit, where=where, when={"seconds": [1.0, 2.0]}, smallest_detectable={})
    for key in ("map", "confusion"):
        del said[key]
    for one in said["ranking"]:
        one["heldout_rmse_change_pa"] = one.pop("heldout_rmse_change")
        del one["says"], one["where"]
    (folder / "diagnosis.json").write_text(json.dumps(said), encoding="utf-8")
    lines = ["test,mode,role,time_s,strain,recorded_pa,declared_pa,refitted_pa,explained_pa"]
    lines += [f'"press",compression,fit,,{1 - 0.02 * k},{-100 * k},{-50 * k},{-90 * k},{-99 * k}' for k in range(8)]
    lines += [f'"hold",compression,check,{k},0.9,{-100 / (1 + k)},-50,-60,{-99 / (1 + k)}' for k in range(8)]
    (folder / "curves.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    page = page_of(read_saved(folder))
    assert "450 → 70 Pa" in page and "It shows most in press (compression), loading" in page
    assert "fibres: a pattern that means nothing does as well with p = 0.01" in page
    assert "pull 80" in page and "Recorded and computed stress of 2 tests" in page


def test_a_diagnosis_of_a_specimen_has_what_its_page_asks_for(tmp_path):
    stretch = np.linspace(0.88, 1.12, 40)
    stress = 2.0 * 700.0 / -15.0 * (stretch**-16.0 - stretch**6.5)
    noise = 5.0 * np.random.default_rng(1).normal(size=40)
    recording = replace(recorded("stretch", stretch), response=stress + noise, name="rod")
    case = replace(case_of(Specimen("cylinder", (8e-3, 8e-3, 5e-3), "lubricated")), recordings=(recording,))
    options = SpecimenOptions(candidates=("asymmetry",))
    found = DiagnosingSpecimen(case, options, "cpu").run()
    assert found.confirmations
    write_curves(tmp_path / "curves.csv", found)
    write_summary(tmp_path / "diagnosis.json", describe_specimen_diagnosis(found, options, "cpu"))
    write_page(tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "asymmetry: a pattern that means nothing does as well with p = " in page


def test_points_that_are_all_set_aside_have_no_figure(folder):
    """Figures of nothing ended in an IndexError."""
    assert "What is left at each of" in page_of(read_saved(folder))
    with (folder / "points.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    with (folder / "points.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0].keys())
        writer.writeheader()
        writer.writerows(row | {"set_aside": 1} for row in rows)
    page = page_of(read_saved(folder))
    assert "What is left at each of" not in page
    assert "Before and after" in page


def test_words_of_a_case_are_no_markup(folder):
    change(folder, case={"name": "x", "title": "</title><script>alert(1)</script>", "origin": "synthetic"})
    page = page_of(read_saved(folder))
    assert "<script>alert" not in page and "&lt;script&gt;alert(1)" in page


def test_the_scene_holds_the_surface(diagnosed, small_diagnosis):
    page = (diagnosed / "report.html").read_text(encoding="utf-8")
    scene = json.loads(re.search(r'id="scene-data">(.*?)</script>', page, re.S)[1])
    points = np.frombuffer(base64.b64decode(scene["points"]), "<f4").reshape(-1, 3)
    triangles = np.frombuffer(base64.b64decode(scene["triangles"]), "<u4").reshape(-1, 3)
    corners = points[triangles]
    # a closed surface: its volume by the divergence theorem is that of the block, 60 mm wide
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert volume == pytest.approx(60.0**3, rel=1e-5)
    left = np.frombuffer(base64.b64decode(scene["arrows"][0]["vectors"]), "<f4").reshape(-1, 3)
    np.testing.assert_allclose(left, 1000.0 * small_diagnosis.case.recordings[0].displacement, atol=1e-4)


def test_a_folder_without_a_diagnosis(tmp_path):
    with pytest.raises(InputError, match=r"diagnosis\.json: cannot be read"):
        write_page(tmp_path)
    (tmp_path / "diagnosis.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match="verdict: missing"):
        write_page(tmp_path)
    assert not (tmp_path / "report.html").exists()
