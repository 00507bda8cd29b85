"""What could be taken for each mechanism."""

from __future__ import annotations

from typing import Any

from warpbrain.report.diagnosis.figures.drawing import TEXT, inlined, panels, shades
from warpbrain.report.generative.page import BLACK

#: A part below this one is not written.
_SHOWN = 0.01
#: Above this part letters are white.
_DARK = 0.55


def confusion_figure(confusion: dict[str, Any]) -> str:
    """Rows: what acts; columns: what imitates it; in the cells percent of what is visible."""
    rows = confusion["rows"]
    columns = list(dict.fromkeys(name for row in rows.values() for name in row))
    figure, (axes,) = panels(1.6 + 0.27 * len(rows))
    _heat(axes, [[row.get(name) for name in columns] for row in rows.values()], list(rows), columns, _SHOWN)
    axes.set_xlabel("what imitates it", fontsize=TEXT)
    axes.set_ylabel("what acts", fontsize=TEXT)
    caption = (
        "Percent of the visible effect of each mechanism, at its middling place, that the best place of another cause "
        "imitates: near 100 these data cannot tell the two apart, however large the effect is."
    )
    pairs = [(part, kind, other) for kind, row in rows.items() for other, part in row.items()]
    most = ", ".join(f"{kind} by {other} {100.0 * part:.0f} %" for part, kind, other in sorted(pairs, reverse=True)[:4])
    return inlined(figure, f"How much of each mechanism others imitate; most: {most}.", caption)


def _heat(axes: Any, shares: list[list[float | None]], rows: list[str], columns: list[str], shown: float) -> None:
    import numpy as np

    found = np.array([[np.nan if share is None else share for share in row] for row in shares], dtype=float)
    axes.imshow(np.ma.masked_invalid(found), cmap=shades(), vmin=0.0, vmax=1.0, aspect="auto")
    for row, column in np.argwhere(found >= shown).tolist():
        share = found[row, column]
        colour = "white" if share > _DARK else BLACK
        axes.text(column, row, f"{100.0 * share:.0f}", ha="center", va="center", fontsize=TEXT - 1, color=colour)
    axes.set_xticks(range(len(columns)), columns, rotation=55, ha="right", rotation_mode="anchor", fontsize=TEXT)
    axes.set_yticks(range(len(rows)), rows, fontsize=TEXT)
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)
