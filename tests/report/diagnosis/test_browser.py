"""The page in a browser: headless Chromium, where there is one, without a network."""

import html
import itertools
import json
import re

import pytest
from browser import EVIL, LISTEN, needs_browser, opened, runs

from warpbrain.report.diagnosis.page import page_of

pytestmark = needs_browser

#: Runs after all else: pixels of the canvas, what switches change, what was fetched.
_LOOK = """<script>
window.addEventListener("load", () => {
  const canvas = document.querySelector("#scene canvas"), gl = canvas.getContext("webgl2");
  const pixels = () => {
    const data = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
    let drawn = 0, sum = 0;
    for (let i = 0; i < data.length; i += 4) {
      if (data[i + 3]) drawn++;
      sum = (sum * 31 + data[i] + 7 * data[i + 1] + 13 * data[i + 2]) % 1000003;
    }
    return { part: drawn / (data.length / 4), sum };
  };
  const acts = {
    start: () => {},
    field: () => document.querySelectorAll("input[name=field]")[2].click(),
    arrows: () => document.querySelectorAll("input[name=arrows]")[0].click(),
    ball: () => document.querySelector("input[name=ball]").click(),
    view: () => document.querySelector("button[data-view=above]").click(),
    keys: () => canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" })),
    wheel: () => canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: 300 })),
  };
  const seen = {}, names = Object.keys(acts);
  const next = () => {
    const name = names.shift();
    if (!name) {
      const all = performance.getEntriesByType("resource").map((one) => one.name);
      const top = document.querySelector(".badge").getBoundingClientRect().top;
      const label = document.querySelector(".bar .label").textContent;
      const fetched = all.filter((one) => !one.startsWith("data:"));
      const found = document.createElement("pre");
      found.id = "found";
      found.textContent = JSON.stringify({ wrong: window.wrong, fetched, seen, label, error: gl.getError(), top });
      document.body.append(found);
      return;
    }
    acts[name]();
    setTimeout(() => { seen[name] = pixels(); next(); }, 50);
  };
  setTimeout(next, 200);
});
</script>"""


def test_the_view_draws_and_switches(diagnosed, tmp_path):
    page = (diagnosed / "report.html").read_text(encoding="utf-8")
    page = page.replace("<head>", "<head>" + LISTEN).replace("</body>", _LOOK + "</body>")
    document = opened(page, tmp_path)
    found = json.loads(html.unescape(re.search(r'<pre id="found">(.*?)</pre>', document, re.S)[1]))
    assert found["wrong"] == [] and found["fetched"] == [] and found["error"] == 0
    assert 0.05 < found["seen"]["start"]["part"] < 0.9
    sums = [one["sum"] for one in found["seen"].values()]
    # each act changes the picture
    assert all(before != after for before, after in itertools.pairwise(sums))
    assert found["seen"]["wheel"]["part"] < found["seen"]["keys"]["part"]
    assert found["label"] == "displacement of the base state [mm]"
    assert 0 < found["top"] < 300


def test_without_webgl_the_page_says_so(diagnosed, tmp_path):
    page = (diagnosed / "report.html").read_text(encoding="utf-8")
    blind = "<script>HTMLCanvasElement.prototype.getContext = () => null;</script>"
    look = """<script>
    document.body.dataset.wrong = window.wrong.length;
    document.body.dataset.shown = getComputedStyle(document.querySelector(".missing")).display;
    </script>"""
    page = page.replace("<head>", "<head>" + LISTEN + blind)
    document = opened(page.replace("</body>", look + "</body>"), tmp_path)
    assert 'data-wrong="0"' in document and 'data-shown="block"' in document


@pytest.mark.slow(6)
def test_nothing_of_a_name_runs(small_diagnosis, summary, tmp_path):
    text, evil = json.dumps(summary), json.dumps(EVIL)[1:-1]
    for name in ("gel", "beads", "others"):
        text = text.replace(name, name + evil)
    assert evil in text
    assert not runs(page_of(small_diagnosis, json.loads(text)), tmp_path)
