"""A page of panels, one a group of studies, and what the pictures of the generative model have in common.

Colours are Okabe and Ito's, which the colour-blind tell apart; what has a colour has a line style, a shade or a hatch
of its own too, so that a print in grey says the same.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.atomic import whole_file
from warpbrain.gp.literature.study import ANATOMIES, METHODS, Study
from warpbrain.gp.process import Process

BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"
BLACK, QUIET, PALE, GROUND = "#000000", "#555555", "#bbbbbb", "#eeeeee"

#: Width of a picture [inch]: two columns of a journal.
WIDTH = 7.2
#: Size of texts [point].
TEXT, SMALL = 7.0, 6.0

#: Half the widths of the bands that hold 50 % and 95 % of new studies [standard deviations].
HALF, MOST = 0.674490, 1.959964


def studies_of(model: Process, group: str) -> tuple[Study, ...]:
    """The studies of a group that a model learnt from."""
    return tuple(study for study in model.studies if study.group == group)


def stretches_of(model: Process, group: str) -> tuple[float, float]:
    """The stretches (low, high) that the studies of a group speak for, all together."""
    ranges = [study.stretch for study in studies_of(model, group)]
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def all_groups(model: Process, height: float, each: int = 1) -> tuple[Any, dict[str, list[Any]]]:
    """A figure with a row for every method and a column for every anatomy.

    Parameters
    ----------
    model : Process
        Groups that it has seen no study of get an empty panel that says so.
    height : float
        Of the figure [inch].
    each : int
        Panels a group, one below the other.

    Returns
    -------
    figure : matplotlib.figure.Figure
    panels : dict of str to list of matplotlib.axes.Axes
        Of the groups that the model has seen.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    grid = figure.subplots(each * len(METHODS), len(ANATOMIES), squeeze=False)
    panels = {}
    for row, method in enumerate(METHODS):
        for column, anatomy in enumerate(ANATOMIES):
            group = f"{method}/{anatomy}"
            stack = [grid[each * row + part, column] for part in range(each)]
            stack[0].set_title(group, fontsize=TEXT)
            if group in model.groups:
                panels[group] = stack
                for axes in stack:
                    axes.tick_params(labelsize=SMALL, length=2.5)
                if row == len(METHODS) - 1:
                    stack[-1].set_xlabel("stretch", fontsize=TEXT)
                continue
            for axes in stack:
                axes.set_xticks([])
                axes.set_yticks([])
                axes.spines[:].set_color(PALE)
                axes.text(0.5, 0.5, "no study", fontsize=TEXT, ha="center", va="center", transform=axes.transAxes)
    return figure, panels


def one_group(group: str, columns: int = 1) -> tuple[Any, list[Any]]:
    """A figure of one group, with panels side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    panels = list(figure.subplots(1, columns, squeeze=False)[0])
    figure.suptitle(group, fontsize=TEXT + 2)
    for axes in panels:
        axes.tick_params(labelsize=TEXT)
        axes.set_xlabel("stretch", fontsize=TEXT + 1)
    return figure, panels


def label(panels: Sequence[Any], what: str, size: float = TEXT) -> None:
    """Name the vertical axis of panels."""
    for axes in panels:
        axes.set_ylabel(what, fontsize=size)


def logarithmic(axes: Any, low: float, high: float) -> None:
    """A logarithmic vertical axis with a few ticks that have numbers: powers of ten, or round ones where it is short.

    It shows a factor of two at least: a spread of one part in a hundred is to look like one.
    """
    from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, NullLocator, StrMethodFormatter

    middle = (low * high) ** 0.5
    low, high = min(low, middle / 2.0**0.5), max(high, middle * 2.0**0.5)
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    if high / low > 100.0:
        axes.yaxis.set_major_locator(LogLocator(numticks=6))
        axes.yaxis.set_minor_locator(LogLocator(subs=range(2, 10)) if high / low < 1e4 else NullLocator())
    else:
        round_ones = LogLocator(subs=(1.0, 2.0, 5.0)) if high / low > 5.0 else MaxNLocator(4, steps=[1, 2, 5, 10])
        axes.yaxis.set_major_locator(round_ones)
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())


def sides(low: float, high: float, nearest: float, count: int) -> Floats:
    """Stretches on both sides of rest, equally spaced but for more of them close to it, where energies vanish.

    Parameters
    ----------
    low, high : float
        Where they end, on either side of 1.
    nearest : float
        Where they begin, as a part of the way from rest to the end.
    count : int
        Of the equal steps of a side.
    """
    step = 1.0 / count
    part = np.concatenate([np.geomspace(nearest, step, 12)[:-1], np.linspace(step, 1.0, count)])
    return np.concatenate([1.0 + (low - 1.0) * part[::-1], 1.0 + (high - 1.0) * part])


def save(figure: Any, path: Path) -> None:
    """Write a figure, whole, in the format that the file's ending names; pixels are those of print, 300 an inch."""
    with whole_file(path) as temporary, warnings.catch_warnings():
        # a name of a user's study in a script that the font lacks is no reason to print anything
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(temporary, dpi=300, format=path.suffix[1:])
