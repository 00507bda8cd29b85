"""Tables as HTML."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

#: Characters of a cell that is never broken.
_SHORT = 8


def table(head: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = (), caption: str = "") -> str:
    """A table of HTML cells; columns of numbers are set to the right, columns in which nothing stands are left out."""
    lines = [list(row) for row in rows]
    shown = [k for k in range(len(head)) if not lines or any(line[k] for line in lines)]
    kinds = {k: "number" if k in numbers else _width(line[k] for line in lines) for k in shown}
    top = "".join(f'<th scope="col" class="{kinds[k]}">{head[k]}</th>' for k in shown)
    body = "".join(
        "<tr>" + "".join(f'<td class="{kinds[k]}">{line[k]}</td>' for k in shown) + "</tr>" for line in lines
    )
    # above what scrolls, and not a caption of the table, which would be as wide as it
    title = f'<p class="note">{caption}</p>' if caption else ""
    named = f' aria-label="{caption}"' if caption else ""
    return (
        f'{title}<div class="wide" tabindex="0"><table{named}>'
        f"<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _width(cells: Iterable[str]) -> str:
    """The class of a column of words: those of one word, such as units, need no room for lines."""
    return "short" if all(len(cell) <= _SHORT for cell in cells) else ""
