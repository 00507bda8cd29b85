"""The model in log energy far beyond the studies, beside another one: in the spirit of the supplement's Fig. 4."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.gp.literature.study import OFFSET
from warpbrain.gp.process import Process
from warpbrain.report import views
from warpbrain.report.generative import page

#: Stretches that are shown, rest among them, and energies [Pa]: bands that leave these are wider than the picture.
_STRETCHES = np.linspace(0.5, 1.5, 251)
_ENERGIES = (1e-5, 1e7)
_BAND: dict[str, Any] = {"facecolor": page.SKY, "alpha": 0.55, "linewidth": 0.0}
_OTHER_BAND: dict[str, Any] = {"facecolor": "none", "edgecolor": page.ORANGE, "hatch": "////", "linewidth": 0.0}
_MEAN: dict[str, Any] = {"color": page.BLUE, "linewidth": 1.3}
_OTHER_MEAN: dict[str, Any] = {"color": page.VERMILLION, "linewidth": 1.0, "linestyle": (0, (4, 1.2))}
_STUDY: dict[str, Any] = {"color": page.BLACK, "linewidth": 0.4}


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
        page.label([axes], axis, page.TEXT + 1)
    else:
        figure, panels = page.all_groups(model, 6.2)
        for name, [axes] in panels.items():
            _draw(axes, model, other, name)
            if axes.get_subplotspec().is_first_col():
                page.label([axes], axis)
    views.legend(figure, _entries(model, other), loc="outside lower center", ncols=3, fontsize=page.TEXT)
    return figure


def _draw(axes: Any, model: Process, other: Process, group: str) -> None:
    l = _STRETCHES
    axes.axvspan(*page.stretches_of(model, group), color=page.GROUND, linewidth=0.0, zorder=0)
    if group in other.groups:
        low, mean, high = _curves(other, group)
        axes.fill_between(l, low, high, zorder=1, **_OTHER_BAND)
        for edge in (low, high):
            axes.plot(l, edge, color=page.ORANGE, linewidth=0.6, zorder=2)
        axes.plot(l, mean, zorder=4, **_OTHER_MEAN)
    low, mean, high = _curves(model, group)
    axes.fill_between(l, low, high, zorder=3, **_BAND)
    axes.plot(l, mean, zorder=5, **_MEAN)
    for study in page.studies_of(model, group):
        at = np.linspace(*study.stretch, 101)
        axes.plot(at, study.energy(at) + OFFSET, zorder=6, **_STUDY)
    axes.set_xlim(l[0], l[-1])
    axes.set_xticks([l[0], 1.0, l[-1]])
    page.logarithmic(axes, *_ENERGIES)


def _curves(model: Process, group: str) -> list[Floats]:
    """Lower end of the band, mean and upper end, energies (n,) in Pa; a band may be hundreds of decades wide."""
    return list(np.exp(np.clip(model.curve(group, _STRETCHES, (-page.MOST, 0.0, page.MOST)), -500.0, 500.0)))


def _entries(model: Process, other: Process) -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    names = [f"{one.name}, {one.variant}" for one in (model, other)]
    return [
        (Line2D([], [], **_STUDY), "studies"),
        (Patch(facecolor=page.GROUND), "stretches of these"),
        (Line2D([], [], **_MEAN), f"{names[0]}: mean"),
        (Patch(**_BAND), "its 95 %"),
        (Line2D([], [], **_OTHER_MEAN), f"{names[1]}: mean"),
        (Patch(**{**_OTHER_BAND, "linewidth": 0.6}), "its 95 %"),
    ]
