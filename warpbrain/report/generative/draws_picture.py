"""The distribution of each group with draws from it, as energy and as secant modulus: the supplement's Fig. 5."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.gp.process import Process
from warpbrain.gp.secant import invariant
from warpbrain.report import views
from warpbrain.report.generative import page

Floats = NDArray[np.float64]

_DRAWS = 6
#: Points to each side of rest; rest itself has no secant modulus.
_POINTS = 60
#: Energies are shown down to those at this part of the way from rest to the end of the range.
_NEAREST = 0.08


def draw_draws(model: Process, group: str | None = None, seed: int = 0) -> Any:
    """Draw mean, bands of 50 % and 95 % and some draws.

    Parameters
    ----------
    model : Process
    group : str, optional
        Only this one, in larger panels.
    seed : int
        Of the draws.

    Returns
    -------
    matplotlib.figure.Figure
    """
    if group is not None:
        figure, [energy, modulus] = page.one_group(group, 2)
        _draw(energy, modulus, model, group, seed)
        page.label([energy], "strain energy [Pa]", page.TEXT + 1)
        page.label([modulus], "secant shear modulus [Pa]", page.TEXT + 1)
    else:
        figure, panels = page.all_groups(model, 9.2, each=2)
        for name, (energy, modulus) in panels.items():
            _draw(energy, modulus, model, name, seed)
            energy.tick_params(labelbottom=False)
            if energy.get_subplotspec().is_first_col():
                page.label([energy], "energy [Pa]", page.SMALL)
                page.label([modulus], "secant modulus [Pa]", page.SMALL)
    figure.supxlabel("stretch", fontsize=page.TEXT + 1)
    views.legend(figure, _entries(), loc="outside lower center", ncols=4, fontsize=page.TEXT)
    return figure


def _draw(energy: Any, modulus: Any, model: Process, group: str, seed: int) -> None:
    low, high = page.stretches_of(model, group)
    sides = np.linspace(_NEAREST, 1.0, _POINTS)
    l = np.concatenate([1.0 - (1.0 - low) * sides[::-1], 1.0 + (high - 1.0) * sides])
    bands = {k: np.exp(model.curve(group, l, k)) for k in (-page.MOST, -page.HALF, 0.0, page.HALF, page.MOST)}
    draws = [np.exp(model.draw([group], l, number, seed)[0]) for number in range(_DRAWS)]
    for axes, scale in ((energy, np.ones_like(l)), (modulus, 1.0 / invariant(l))):
        axes.fill_between(l, scale * bands[-page.MOST], scale * bands[page.MOST], color="#cfe3f1", linewidth=0.0)
        axes.fill_between(l, scale * bands[-page.HALF], scale * bands[page.HALF], color="#86b8dc", linewidth=0.0)
        for draw in draws:
            axes.plot(l, scale * draw, color=page.VERMILLION, linewidth=0.7, linestyle=(0, (4, 1.2)))
        axes.plot(l, scale * bands[0.0], color=page.BLACK, linewidth=1.1)
        axes.set_xlim(low, high)
        axes.set_xticks([low, 1.0, high], labels=[f"{tick:g}" for tick in (low, 1.0, high)])
        shown = np.array([*bands.values(), *draws]) * scale
        page.decades(axes, 0.8 * shown.min(), 1.25 * shown.max())


def _entries() -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    return [
        (Line2D([], [], color=page.BLACK, linewidth=1.1), "mean"),
        (Patch(facecolor="#86b8dc"), "50 %"),
        (Patch(facecolor="#cfe3f1"), "95 %"),
        (Line2D([], [], color=page.VERMILLION, linewidth=0.7, linestyle=(0, (4, 1.2))), "draws"),
    ]
