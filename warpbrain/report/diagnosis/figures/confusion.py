"""What could be taken for each mechanism."""

from __future__ import annotations

from typing import Any

from warpbrain.report.generative.page import BLACK
from warpbrain.report.page.figures import TEXT, inlined, panels, shades

#: A part below this one is not written.
_SHOWN = 0.01
#: Above this part letters are white.
_DARK = 0.55


def confusion_figure(confusion: dict[str, Any]) -> str:
    """Rows: what acts; columns: what imitates it; in the cells percent of what is visible."""
    rows = confusion["rows"]
    columns = list(dict.fromkeys(name for row in rows.values() for name in row))

    def draw(narrow: bool) -> Any:
        figure, (axes,) = panels(narrow, 1.6 + 0.27 * len(rows))
        found = [[row.get(name) for name in columns] for row in rows.values()]
        _heat(axes, found, list(rows), columns, _SHOWN, TEXT - 2.5 if narrow else TEXT)
        axes.set_xlabel("what imitates it", fontsize=TEXT)
        axes.set_ylabel("what acts", fontsize=TEXT)
        return figure

    caption = (
        "Percent of the visible effect of each mechanism, at its middling place, that the best place of another cause "
        "imitates: near 100 these data cannot tell the two apart, however large the effect is."
    )
    pairs = [(part, kind, other) for kind, row in rows.items() for other, part in row.items()]
    most = ", ".join(f"{kind} by {other} {100.0 * part:.0f} %" for part, kind, other in sorted(pairs, reverse=True)[:4])
    return inlined(draw, f"How much of each mechanism others imitate; most: {most}.", caption)


def _heat(
    axes: Any, shares: list[list[float | None]], rows: list[str], columns: list[str], shown: float, size: float
) -> None:
    import numpy as np

    found = np.array([[np.nan if share is None else share for share in row] for row in shares], dtype=float)
    axes.imshow(np.ma.masked_invalid(found), cmap=shades(), vmin=0.0, vmax=1.0, aspect="auto")
    for row, column in np.argwhere(found >= shown).tolist():
        share = found[row, column]
        colour = "white" if share > _DARK else BLACK
        axes.text(column, row, f"{100.0 * share:.0f}", ha="center", va="center", fontsize=size - 1, color=colour)
    axes.set_xticks(range(len(columns)), columns, rotation=55, ha="right", rotation_mode="anchor", fontsize=size)
    axes.set_yticks(range(len(rows)), rows, fontsize=size)
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)
