"""The model in log energy far beyond the studies, beside another one: in the spirit of the supplement's Fig. 4."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.gp.literature.dataset import OFFSET
from warpbrain.gp.process import Process
from warpbrain.report import views
from warpbrain.report.generative import page

#: Stretches that are shown, and energies [Pa]: bands that leave these are wider than the picture.
_STRETCHES = np.linspace(0.5, 1.5, 251)
_ENERGIES = (1e-5, 1e7)


def draw_extrapolation(model: Process, other: Process, group: str | None = None) -> Any:
    """Draw the mean and the band of 95 % over wide stretches.

    Parameters
    ----------
    model, other : Process
        The second is drawn behind, for comparison.
    group : str, optional
        Only this one, in a larger panel.

    Returns
    -------
    matplotlib.figure.Figure
    """
    axis = f"strain energy + {OFFSET:g} [Pa]"
    if group is not None:
        figure, [axes] = page.one_group(group)
        _draw(axes, model, other, group)
        axes.set_xlabel("stretch", fontsize=page.TEXT + 1)
        page.label([axes], axis, page.TEXT + 1)
        columns = 2
    else:
        figure, panels = page.all_groups(model, 5.6)
        for name, [axes] in panels.items():
            _draw(axes, model, other, name)
        figure.supxlabel("stretch", fontsize=page.TEXT + 1)
        figure.supylabel(axis, fontsize=page.TEXT + 1)
        columns = 5
    views.legend(figure, _entries(model, other), loc="outside lower center", ncols=columns, fontsize=page.TEXT)
    return figure


def _draw(axes: Any, model: Process, other: Process, group: str) -> None:
    l = _STRETCHES
    axes.axvspan(*page.stretches_of(model, group), color="#eeeeee", linewidth=0.0, zorder=0)
    if group in other.groups:
        low, high = (np.exp(np.clip(other.curve(group, l, k), -500.0, 500.0)) for k in (-page.MOST, page.MOST))
        axes.fill_between(l, low, high, facecolor="none", edgecolor=page.ORANGE, hatch="////", linewidth=0.0, zorder=1)
        for edge in (low, high):
            axes.plot(l, edge, color=page.VERMILLION, linewidth=0.6, linestyle="--", zorder=2)
    low, mean, high = (np.exp(model.curve(group, l, k)) for k in (-page.MOST, 0.0, page.MOST))
    axes.fill_between(l, low, high, color=page.SKY, alpha=0.55, linewidth=0.0, zorder=3)
    for study in page.studies_of(model, group):
        at = np.linspace(*study.stretch, 101)
        axes.plot(at, study.energy(at) + OFFSET, color=page.BLACK, linewidth=0.35, zorder=4)
    axes.plot(l, mean, color=page.BLUE, linewidth=1.2, zorder=5)
    axes.set_xlim(l[0], l[-1])
    axes.set_xticks([0.5, 1.0, 1.5])
    page.decades(axes, *_ENERGIES)


def _entries(model: Process, other: Process) -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    return [
        (Line2D([], [], color=page.BLACK, linewidth=0.5), "studies"),
        (Patch(facecolor="#eeeeee"), "stretches of these"),
        (Line2D([], [], color=page.BLUE, linewidth=1.2), f"{model.name}, mean"),
        (Patch(facecolor=page.SKY, alpha=0.55), "its 95 %"),
        (
            Patch(facecolor="none", edgecolor=page.VERMILLION, hatch="////", linewidth=0.6, linestyle="--"),
            f"{other.name}, 95 %",
        ),
    ]
