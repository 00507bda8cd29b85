"""Words of the site's pages, all of them: `python docs/count_words.py`, as `cat docs/**/*.md | wc -w` counts them.

Tables of results are data that a build includes (`bench/results`, `*.csv`), and are not counted.
"""

from __future__ import annotations

from pathlib import Path

DOCS = Path(__file__).parent
#: Words at most, of all pages together: prose, tables and code.
MOST = 25_000


def words(text: str) -> int:
    """Words of a page, whatever they stand in."""
    return len(text.split())


def pages() -> list[Path]:
    """All pages but those that a build makes."""
    return sorted(page for page in DOCS.rglob("*.md") if not {"_build", "gallery"} & set(page.relative_to(DOCS).parts))


if __name__ == "__main__":
    counted = {page: words(page.read_text(encoding="utf-8")) for page in pages()}
    for page, count in sorted(counted.items(), key=lambda one: one[1]):
        print(f"{page.relative_to(DOCS).as_posix():<40} {count:>6}")
    print(f"{'all':<40} {sum(counted.values()):>6}")
