"""Figures of a page: each in two layouts, of which a browser shows the one that fits its window."""

from __future__ import annotations

import base64
import html
import io
import warnings
from collections.abc import Callable
from typing import Any

#: Of a page for one inch of a figure, so that texts of all are alike.
_PIXELS = 112
#: Width of a figure [inch] on a wide window and on a narrow one, and size of its texts [point].
WIDTH, NARROW, TEXT = 8.0, 4.0, 9.0
#: Windows up to this width show the narrow layout [pixel].
_NARROW_WINDOW = 640


def panels(narrow: bool, height: float, count: int = 1, width: float = WIDTH, **options: Any) -> tuple[Any, list[Any]]:
    """A figure with panels side by side, or on a narrow window one below the other, each of that height [inch].

    What matplotlib draws is white, whatever the page is.
    """
    from matplotlib.figure import Figure

    size, shape = ((NARROW, height * count), (count, 1)) if narrow else ((width, height), (1, count))
    figure = Figure(figsize=size, layout="constrained", facecolor="white")
    axes = list(figure.subplots(*shape, squeeze=False, **options).ravel())
    for one in axes:
        one.tick_params(labelsize=TEXT - 1)
        for side in ("top", "right"):
            one.spines[side].set_visible(False)
    return figure, axes


def inlined(draw: Callable[[bool], Any], alternative: str, caption: str) -> str:
    """A figure as HTML that needs no other file; pixels, since a drawing may have thousands of pieces.

    Parameters
    ----------
    draw : callable
        Draws it: on a narrow window if it is told so.
    alternative, caption : str
        In words; the first is for those who do not see it.
    """
    wide, narrow = draw(False), draw(True)
    return (
        f'<figure><picture><source media="(max-width: {_NARROW_WINDOW}px)" srcset="{_data(narrow)}">'
        f'<img src="{_data(wide)}" width="{_PIXELS * wide.get_figwidth():.0f}" alt="{html.escape(alternative)}">'
        f"</picture><figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def _data(figure: Any) -> str:
    stream = io.BytesIO()
    with warnings.catch_warnings():
        # a name in a script that the font lacks is no reason to print anything
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(stream, format="png", dpi=170)
    return f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}"


def shades() -> Any:
    """Colours of a map from light to dark: grey print shows them, and arrows of any colour stand out of them."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    # from the second lightest on: what is light is still there
    return LinearSegmentedColormap.from_list("shades", colormaps["bone_r"]([0.04, 0.2, 0.35, 0.5, 0.65, 0.8]))
