"""Words of the site's pages: `python docs/count_words.py`. Prose counts; tables and code are looked up, not read."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).parent
#: Words of prose at most, of all pages together.
MOST = 25_000


def words(text: str) -> tuple[int, int, int]:
    """Words of prose, of tables, and of code, of a page in Markdown."""
    fenced = re.compile(r"^```.*?^```$", flags=re.DOTALL | re.MULTILINE)
    in_code = sum(len(block.split()) for block in fenced.findall(text))
    lines = fenced.sub("", text).splitlines()
    # of items of lists no line that goes on is indented by as much
    in_code += sum(len(line.split()) for line in lines if line.startswith("    "))
    rest = "\n".join(line for line in lines if not line.startswith("    "))
    table = [line for line in rest.splitlines() if line.startswith("|")]
    in_tables = sum(len(line.split()) for line in table)
    return len(rest.split()) - in_tables, in_tables, in_code


def pages() -> list[Path]:
    """All pages but those that a build makes."""
    return sorted(page for page in DOCS.rglob("*.md") if not {"_build", "gallery"} & set(page.relative_to(DOCS).parts))


if __name__ == "__main__":
    counted = {page: words(page.read_text(encoding="utf-8")) for page in pages()}
    for page, (prose, tables, code) in counted.items():
        print(f"{page.relative_to(DOCS).as_posix():<40} {prose:>6} {tables:>6} {code:>6}")
    prose, tables, code = (sum(column) for column in zip(*counted.values(), strict=True))
    print(f"{'words of prose, of tables, of code':<40} {prose:>6} {tables:>6} {code:>6}")
