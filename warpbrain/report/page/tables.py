"""Tables as HTML."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = (), caption: str = "") -> str:
    """A table of HTML cells; columns of numbers are set to the right, columns in which nothing stands are left out."""
    lines = [list(row) for row in rows]
    shown = [k for k in range(len(head)) if not lines or any(line[k] for line in lines)]
    kinds = {k: "number" if k in numbers else "" for k in shown}
    top = "".join(f'<th scope="col" class="{kinds[k]}">{head[k]}</th>' for k in shown)
    body = "".join(
        "<tr>" + "".join(f'<td class="{kinds[k]}">{line[k]}</td>' for k in shown) + "</tr>" for line in lines
    )
    title = f"<caption>{caption}</caption>" if caption else ""
    return (
        f'<div class="wide" tabindex="0"><table>{title}<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'
    )
