"""What docs/generative-model.md shows: the file of a user's study, the code, and the pictures."""

import re
from pathlib import Path

from warpbrain.gp.literature.studies import read_studies

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "generative-model.md").read_text(encoding="utf-8")


def block(language):
    [found] = re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    return found


def test_the_file_of_a_study(tmp_path):
    path = tmp_path / "studies.toml"
    path.write_text(block("toml"))
    assert len(block("toml").splitlines()) == 1 + 3
    mine = read_studies(add=path)[-1]
    assert (mine.paper, mine.form, mine.stretch) == ("Someone2026", "neo-hookean", (0.9, 1.1))
    assert mine.shear_moduli == (1200.0, 1200.0)


def test_the_code(capsys):
    names = {}
    exec(block("python"), names)
    assert "Ogden" in capsys.readouterr().out
    assert names["simulated"].mesh.volume > 0.0


def test_the_pictures_are_there():
    links = re.findall(r"\((figures/[^)]+)\)", PAGE)
    assert len(links) >= 4
    for link in links:
        assert (DOCS / link).is_file(), link
