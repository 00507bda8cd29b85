"""What would be said of virtual cases: of each cause, and of each mechanism by how visible it is."""

from __future__ import annotations

from typing import Any

from warpbrain.diagnosis.result import NOT_PHYSICS, NOTHING, VERDICTS, WITH_IT, WITHOUT_IT
from warpbrain.report.diagnosis.figures.drawing import TEXT, inlined, panels, shades
from warpbrain.report.generative.page import BLACK

#: A share below this one is not written where most are none.
_SHOWN = 0.01
#: Above this share letters are white.
_DARK = 0.55


def confusion_figure(confusion: dict[str, Any]) -> str:
    """Rows: what is missing; columns: what would be said; in the cells percent of virtual cases."""
    rows = confusion["rows"]
    columns = [NOTHING, *confusion["named"], WITH_IT, WITHOUT_IT, *VERDICTS]
    # a mechanism that is never named rightly still has its column: that is what the figure is there to show
    said = {name for row in rows.values() for name, share in row.items() if share >= _SHOWN} | set(confusion["named"])
    columns = [name for name in dict.fromkeys(columns) if name in said]
    figure, (axes,) = panels(1.6 + 0.27 * len(rows))
    shares = [[row.get(name, 0.0) for name in columns] for row in rows.values()]
    _heat(axes, shares, list(rows), columns, _SHOWN)
    for place, name in enumerate(columns):
        right = [cause for cause in rows if cause == name or (name == NOT_PHYSICS and cause not in columns)]
        for cause in right:
            axes.add_patch(_frame(place, list(rows).index(cause)))
    axes.set_xlabel("what would be said", fontsize=TEXT)
    axes.set_ylabel("what is missing", fontsize=TEXT)
    caption = (
        f"Percent of {confusion['cases']} virtual cases of each cause, of the size and at the places that are expected "
        "of it. Framed: right. This is the linear model's own word, and optimistic: fewer real cases are named."
    )
    best = ", ".join(f"{name} {100.0 * rows[name].get(name, 0.0):.0f} %" for name in confusion["named"])
    return inlined(figure, f"How often each mechanism is named rightly: {best}.", caption)


def visibility_figure(confusion: dict[str, Any]) -> str:
    """Alarms and right names of each mechanism against its detectability."""
    kinds = list(confusion["named"])
    sizes = [f"{size:g}" for size in confusion["detectability"]]
    figure, axes = panels(1.0 + 0.27 * len(kinds), 2, sharey=True)
    for one, key, title in zip(axes, ("alarm", "named"), ("with an alarm", "named rightly"), strict=True):
        _heat(one, [confusion[key][kind] for kind in kinds], kinds, sizes, 0.0)
        one.set_title(title, fontsize=TEXT)
        one.set_xlabel("detectability d", fontsize=TEXT)
        one.tick_params(axis="x", rotation=0)
    caption = (
        "Percent of virtual cases of a mechanism, by how visible its effect is: d counts standard deviations of noise "
        "and all that is no physics. Empty: it would have to be implausibly large."
    )
    return inlined(figure, "Shares of virtual cases with an alarm, and named rightly, by mechanism.", caption)


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


def _frame(column: int, row: int) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, fill=False, edgecolor=BLACK, linewidth=1.2)
