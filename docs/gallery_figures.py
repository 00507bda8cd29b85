"""A scraper for sphinx-gallery: figures that results make of themselves, which no window of matplotlib's manages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakSet

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

_shown: WeakSet[Figure] = WeakSet()


def figures(_block: Any, variables: dict[str, Any], conf: dict[str, Any]) -> str:
    """Save the figure that a block has named `figure`, once; those of pyplot are saved by matplotlib's scraper."""
    figure = variables["example_globals"].get("figure")
    if not isinstance(figure, Figure) or hasattr(figure, "number") or figure in _shown:
        return ""
    _shown.add(figure)
    path = next(variables["image_path_iterator"])
    figure.savefig(path, dpi=100)
    return str(figure_rst([path], conf["src_dir"]))


def _get_sg_image_scraper() -> Callable[..., str]:
    """What sphinx-gallery asks a module for."""
    return figures
