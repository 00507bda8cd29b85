"""Names in a case that are HTML are words in its report: opened in headless Chromium, nothing of them runs."""

import pytest
from browser import EVIL, needs_browser, runs
from command import run
from folders import write_recorded

CHANGES = [
    ('title = "A block of gel"', f'title = "{EVIL}"'),
    ('name = "soft"', f'name = "soft{EVIL}"'),
    ('name = "table"', f'name = "table{EVIL}"'),
]
BEADS = f"id,x,y,z,ux,uy,uz\n{EVIL},10,10,10,0.1,0.0,-0.2\nb,20,15,25,0.0,0.1,-0.5\nc,5,5,30,0.3,0,-1\n"


@pytest.mark.slow(12)
@needs_browser
def test_nothing_of_a_name_runs(tmp_path):
    folder = write_recorded(tmp_path / "case", *CHANGES, files={"recordings/beads.csv": BEADS})
    text = (folder / "case.toml").read_text()
    (folder / "case.toml").write_text(text.replace('name = "beads"', f'name = "beads{EVIL}"'))
    ran = run(folder, "--out", tmp_path / "out")
    assert ran.status == 0, ran.err
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert not runs(page, tmp_path)
    # the look itself: what does run is seen
    assert runs(page.replace("</body>", EVIL + "</body>"), tmp_path)
