"""`report.html` of a run: one file, that a browser opens, that says what is worse than nothing and escapes names."""

import html
import json
import re

import pytest
from browser import LISTEN, needs_browser, opened
from command import run
from folders import write_recorded

EVIL = ('title = "A block of gel"', "title = '</title><script>document.body.remove()</script>'")
#: As if the beads had moved the other way: no motion at all is nearer to them.
AWAY = {"recordings/beads.csv": "id,x,y,z,ux,uy,uz\na,10,10,10,0.0,0.0,0.2\nb,20,15,25,0.0,0.0,0.5\nc,5,5,30,0.0,0,1\n"}


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    """What a run printed, and its folder."""
    folder = write_recorded(tmp_path_factory.mktemp("case"), EVIL, files=AWAY)
    out = tmp_path_factory.mktemp("out")
    ran = run(folder, "--out", out)
    assert (ran.status, ran.err) == (0, "")
    return ran, out


@pytest.fixture(scope="module")
def page(reported):
    return (reported[1] / "report.html").read_text(encoding="utf-8")


def test_worse_than_nothing_is_said_everywhere(reported, page):
    ran, out = reported
    said = json.loads((out / "summary.json").read_text(encoding="utf-8"))["recordings"]["in_words"]
    assert re.fullmatch(
        r"It explains 'beads' worse than no motion at all: RMSE [\d.]+ mm with it, 0\.656 mm .*", said[1]
    )
    for sentence in said:
        assert f"  {sentence}\n" in ran.out and sentence in html.unescape(page)


def test_it_is_one_file_in_which_no_name_is_markup(page):
    assert not re.findall(r'(?:src|srcset|href)="(?!data:|#)', page)
    assert "http://" not in page and "https://" not in page and "url(" not in page and "@import" not in page
    assert "<script>document" not in page and "&lt;script&gt;document" in page


def test_it_says_what_was_left_out_and_has_units(page):
    headings = re.findall(r"<h2>(.*?)</h2>", page)
    assert headings == [
        *("Before and after", "What was recorded", "What the model leaves out", "In three dimensions", "Displacement"),
        *("What was assumed", "How it was computed"),
    ]
    assert "falx and tentorium" in page and "mean [mm]" in page and "shear modulus [Pa]" in page
    # one is to be checked only: there is a column that says so
    assert re.search(r"<th[^>]*>role</th>", page) and re.search(r"<td[^>]*>check</td>", page)
    assert not re.search(r">(nan|None|inf)<", page)


_LOOK = """<script>
window.addEventListener("load", () => {
  const canvas = document.querySelector("#scene canvas"), gl = canvas.getContext("webgl2");
  const sum = () => {
    const data = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    return data.reduce((all, value, k) => (all * 31 + value) % 1000003, 7);
  };
  const slide = document.querySelector("input[name=moves]"), sums = [];
  setTimeout(() => {
    sums.push(sum());
    slide.value = 0;
    slide.dispatchEvent(new Event("input"));
    setTimeout(() => {
      sums.push(sum());
      document.querySelector("input[name=cuts]").click();
      setTimeout(() => {
        sums.push(sum());
        const found = document.createElement("pre");
        found.id = "found";
        found.textContent = JSON.stringify({ sums, wrong: window.wrong, said: slide.nextElementSibling.textContent });
        document.body.append(found);
      }, 50);
    }, 50);
  }, 200);
});
</script>"""


@needs_browser
def test_motion_and_cuts_change_the_view(page, tmp_path):
    document = opened(page.replace("<head>", "<head>" + LISTEN).replace("</body>", _LOOK + "</body>"), tmp_path)
    found = json.loads(html.unescape(re.search(r'<pre id="found">(.*?)</pre>', document, re.S)[1]))
    assert found["wrong"] == [] and found["said"] == "0 times" and len(set(found["sums"])) == 3


@needs_browser
def test_it_is_as_narrow_as_a_telephone(page, tmp_path):
    (tmp_path / "inner.html").write_text(page, encoding="utf-8")
    frame = """<iframe src="inner.html" width="400" height="800"></iframe><script>
    window.addEventListener("load", () => {
      const inner = document.querySelector("iframe").contentDocument;
      document.body.dataset.wide = inner.documentElement.scrollWidth;
      const panels = [...inner.querySelectorAll(".panel")].map((one) => one.getBoundingClientRect().left);
      document.body.dataset.columns = new Set(panels).size;
    });
    </script>"""
    document = opened(f"<!DOCTYPE html><html><body>{frame}</body></html>", tmp_path)
    wide, columns = (int(re.search(rf'data-{name}="(\d+)"', document)[1]) for name in ("wide", "columns"))
    assert wide <= 400 and columns == 1
