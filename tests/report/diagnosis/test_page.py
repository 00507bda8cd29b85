"""The page of a diagnosis: one file, complete for every verdict, and for what has no mesh."""

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from sinking_block import OPTIONS, verdict_of
from testing_machine import case_of, recorded

from warpbrain.cases.specimen import Specimen
from warpbrain.inference.decide import VERDICTS
from warpbrain.report.diagnosis.description import describe
from warpbrain.report.diagnosis.page import page_of
from warpbrain.worlds.options import DiagnosisOptions
from warpbrain.worlds.specimen.diagnose import DiagnosingSpecimen


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


def words(page):
    return re.sub(r"base64,[^\"]*", "", page[page.index("<main>") :])


@pytest.mark.parametrize("verdict", [v for v in VERDICTS if v != "named"])
def test_every_verdict_has_a_page(small_diagnosis, verdict, monkeypatch):
    # pictures are the same for all
    monkeypatch.setattr("warpbrain.report.diagnosis.page.pictures_of", lambda *_: {})
    found = replace(verdict_of(small_diagnosis, verdict), next_measurement=())
    page = page_of(found, describe(found, OPTIONS, "cpu"))
    assert f'class="badge">{verdict}<' in page
    body = words(page)
    assert "<canvas" not in body and not re.search(r"\b(nan|None|inf)\b", body)
    assert not re.search(r"\b(nats|100 %|above 99 %)", body)


def test_a_specimen_has_curves_in_the_place_of_an_anatomy():
    stretch = np.linspace(0.88, 1.12, 40)
    stress = 2.0 * 700.0 / -15.0 * (stretch**-16.0 - stretch**6.5)
    noise = 5.0 * np.random.default_rng(1).normal(size=40)
    rod = replace(recorded("stretch", stretch), response=stress + noise, name="rod & <more>")
    pull = replace(rod, name="pull", role="check", response=stress)
    case = replace(case_of(Specimen("cylinder", (8e-3, 8e-3, 5e-3), "lubricated")), recordings=(rod, pull))
    options = DiagnosisOptions(candidates=("asymmetry",))
    found = DiagnosingSpecimen(case, options, "cpu").run()
    summary = describe(found, options, "cpu")
    page = page_of(found, summary)
    body = words(page)
    assert "asymmetry: a pattern that means nothing does as well with p = " in body
    before, after = (f"{found.scores[state].heldout:.3g}" for state in ("refitted", "explained"))
    assert f"{before} → {after} Pa" in body
    assert "The mismatch is largest in rod &amp; &lt;more&gt; (axial), loading, at stretches or shears from" in body
    assert f"pull {found.scores['explained'].check['pull']:.4g}" in body
    assert "Recorded and computed stress of 2 tests" in body and body.count("<img") == 1
    # sets of causes as of a body
    assert "aria-label" in body and "set of causes" in body and "One after the other" not in body
    for one in found.combinations[:6]:
        assert " and ".join(one.causes) in body
    assert not re.search(r"\b(nan|None|inf)\b", body)


def test_points_that_are_all_set_aside_have_no_figure(small_diagnosis, summary, monkeypatch):
    """Figures of nothing ended in an IndexError."""
    everything = property(lambda self: np.ones(len(self.base.residual), dtype=bool))
    monkeypatch.setattr(type(small_diagnosis), "gross", everything)
    page = page_of(small_diagnosis, summary)
    assert "What is left at each of" not in page
    assert "Before and after" in page


def test_words_of_a_case_are_no_markup(small_diagnosis, monkeypatch):
    monkeypatch.setattr("warpbrain.report.diagnosis.page.pictures_of", lambda *_: {})
    bad = "</title><script>alert(1)</script>"
    found = replace(
        small_diagnosis,
        case=replace(small_diagnosis.case, title=bad),
        remarks=(bad,),
        assumptions=(bad,),
        doubts=(bad,),
    )
    page = page_of(found, describe(found, OPTIONS, bad))
    assert "<script>alert" not in page and page.count("&lt;script&gt;alert(1)") >= 5


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
