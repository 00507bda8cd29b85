"""What the figures of a diagnosis share: colours of states that grey print keeps apart, and how a page holds them."""

from __future__ import annotations

import base64
import html
import io
import warnings
from typing import Any

from warpbrain.report.generative.page import BLUE, ORANGE, VERMILLION

#: Colour and marker of each state; in grey the first is the darkest.
COLOURS = {"declared": VERMILLION, "refitted": ORANGE, "explained": BLUE}
MARKERS = {"declared": "x", "refitted": "+", "explained": "o"}

#: Of a page for one inch of a figure, so that texts of all are alike.
_PIXELS = 112
#: Width of a figure [inch], and size of its texts [point].
WIDTH, TEXT = 8.0, 9.0


def panels(height: float, count: int = 1, width: float = WIDTH, **options: Any) -> tuple[Any, list[Any]]:
    """A figure with panels side by side; what matplotlib draws is white, whatever the page is."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    axes = list(figure.subplots(1, count, squeeze=False, **options)[0])
    for one in axes:
        one.tick_params(labelsize=TEXT - 1)
        for side in ("top", "right"):
            one.spines[side].set_visible(False)
    return figure, axes


def inlined(figure: Any, alternative: str, caption: str) -> str:
    """A figure as HTML that needs no other file; pixels, since a drawing may have thousands of pieces."""
    stream = io.BytesIO()
    with warnings.catch_warnings():
        # a name in a script that the font lacks is no reason to print anything
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(stream, format="png", dpi=170)
    text = base64.b64encode(stream.getvalue()).decode()
    return (
        f'<figure><img src="data:image/png;base64,{text}" width="{_PIXELS * figure.get_figwidth():.0f}" '
        f'alt="{html.escape(alternative)}">'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def shades() -> Any:
    """Colours of a map from light to dark: grey print shows them, and arrows of any colour stand out of them."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    # from the second lightest on: what is light is still there
    return LinearSegmentedColormap.from_list("shades", colormaps["bone_r"]([0.04, 0.2, 0.35, 0.5, 0.65, 0.8]))
