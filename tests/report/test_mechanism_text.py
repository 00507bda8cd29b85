"""The page of the mechanisms is that of the code."""

from pathlib import Path

from warpbrain.physics.mechanisms import mechanisms
from warpbrain.report.mechanism_text import page

PAGE = Path(__file__).parents[2] / "docs" / "mechanisms.md"


def test_the_page_has_not_drifted():
    assert PAGE.read_text(encoding="utf-8") == page(), "run python docs/make_mechanisms.py"


def test_every_mechanism_has_its_four_faces():
    for kind, mechanism in mechanisms().items():
        assert f"## {kind}\n" in page()
        assert mechanism.sentence.endswith(".")
        assert set(mechanism.confused_with) <= {*mechanisms(), "drainage"}
        for name, says in mechanism.parameters().items():
            assert says.doc.endswith("."), f"{kind}: {name}"
