"""Figures of a page: each in two layouts, of which a browser shows the one that fits its window."""

import base64
import io
from collections.abc import Callable, Sequence
from typing import Any

from warpbrain.report import views

#: Of a page for one inch of a figure, so that texts of all are alike.
_PIXELS = 112
#: Width of a figure [inch] on a wide window and on a narrow one, and size of its texts [point].
WIDTH, NARROW, TEXT = 8.0, 4.0, 9.0
#: Windows up to this width show the narrow layout [pixel].
_NARROW_WINDOW = 640


def side_by_side(
    count: int, narrow: bool, height: float, size: tuple[float, float], **options: Any
) -> tuple[Any, list[Any]]:
    """A figure of a size [inch] with panels side by side, or one below the other, each of that height [inch]."""
    if narrow:
        return views.panels(count, 1, (NARROW, height * count), **options)
    return views.panels(1, count, size, **options)


def panels(narrow: bool, height: float, count: int = 1, width: float = WIDTH, **options: Any) -> tuple[Any, list[Any]]:
    """A figure with panels side by side, or on a narrow window one below the other, each of that height [inch]."""
    figure, axes = side_by_side(count, narrow, height, (width, height), **options)
    for panel in axes:
        panel.tick_params(labelsize=TEXT - 1)
        panel.spines[["top", "right"]].set_visible(False)
    return figure, axes


def colour_bar(figure: Any, drawn: Any, axes: Sequence[Any], narrow: bool, label: str) -> Any:
    """The bar of what was drawn in colours, below all panels."""
    bar = figure.colorbar(drawn, ax=axes, location="bottom", shrink=0.9 if narrow else 0.5, aspect=40, pad=0.02)
    bar.set_label(label, fontsize=TEXT - 1)
    bar.ax.tick_params(labelsize=TEXT - 2)
    return bar


def inlined(draw: Callable[[bool], Any], **told: Any) -> dict[str, Any]:
    """What the macro `figure` of a page takes: a figure that needs no other file, in pixels, since a drawing may have
    thousands of pieces; and what else is `told` of it.

    `draw` draws it, on a narrow window if it is told so.
    """
    wide = draw(False)
    layouts = {"wide": _png(wide), "narrow": _png(draw(True)), "window": _NARROW_WINDOW}
    return {**layouts, "width": f"{_PIXELS * wide.get_figwidth():.0f}", **told}


def _png(figure: Any) -> str:
    stream = io.BytesIO()
    views.write_png(figure, stream, 170.0)
    return data("png", stream)


def data(kind: str, stream: io.BytesIO) -> str:
    """An image as the address of a page that needs no other file."""
    return f"data:image/{kind};base64,{base64.b64encode(stream.getvalue()).decode()}"


def shades() -> Any:
    """Colours of a map from light to dark: grey print shows them, and arrows of any colour stand out of them."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    # from the second lightest on: what is light is still there
    return LinearSegmentedColormap.from_list("shades", colormaps["bone_r"]([0.04, 0.2, 0.35, 0.5, 0.65, 0.8]))
