"""Pages for people: what they link to, and the files that the house names, are there."""

import datetime
import re
from collections.abc import Iterator
from pathlib import Path

from figure_records import read_records

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "warpbrain"
#: Folders with pages; the root has pages of its own.
FOLDERS = ("docs", "bench", "concealed", "packaging", "paper", "referee", "tests", "warpbrain")
PAGES = sorted([*ROOT.glob("*.md"), *(page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md"))])


def prose(page: Path) -> str:
    """A page without its examples: indented blocks and code."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"`[^`\n]*`", "``", re.sub(r"^    .*$", "", text, flags=re.MULTILINE))


def headings(page: Path) -> set[str]:
    """As links to them are written."""
    found = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in found}


def test_links_lead_somewhere():
    for page in PAGES:
        for link in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
            if "://" in link:
                continue
            name, _, heading = link.partition("#")
            file = page.parent / name if name else page
            assert file.exists(), f"{page}: {link}"
            assert not heading or heading in headings(file), f"{page}: {link}"


def test_every_picture_is_on_a_page():
    pages = [page.read_text(encoding="utf-8") for page in PAGES]
    for picture in (ROOT / "docs" / "figures").iterdir():
        assert any(f"figures/{picture.name})" in page for page in pages), picture.name


def test_every_picture_has_the_command_that_made_it_and_its_date():
    records = read_records()
    assert set(records) == {picture.name for picture in (ROOT / "docs" / "figures").iterdir()}
    for command, date in records.values():
        assert (ROOT / command.split()[1]).is_file(), command
        assert datetime.date.fromisoformat(date) <= datetime.date.today()


def named_files() -> Iterator[str]:
    """Files and folders of the package, the referee and the tests that docs/house.md names in its table."""
    for row in (ROOT / "docs" / "house.md").read_text(encoding="utf-8").splitlines():
        if row.startswith("| "):
            room = ""
            for name in re.findall(r"`([\w/.]+)`", row.rpartition(" | ")[2]):
                if "/" in name:
                    room = name.rpartition("/")[0]
                    yield name
                elif re.search(r"\.\w{2,4}$", name):
                    # the room is said once in a row
                    yield f"{room}/{name}" if room else name


def test_the_house_names_what_is_there():
    names = set(named_files())
    assert names
    for name in names:
        assert (PACKAGE / name).exists() or (ROOT / name).exists(), name
