"""The distribution of each group with draws from it, as energy and as secant modulus: the supplement's Fig. 5."""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.gp.literature.study import OFFSET
from warpbrain.gp.process import Process
from warpbrain.gp.secant import invariant
from warpbrain.report import views
from warpbrain.report.generative import page

_DRAWS = 16
#: Steps to each side of rest: bands of the paper's process widen between any two of its hundred points a study.
_STEPS = 160
#: Parts of the way from rest to the end of the range: where curves of energy begin, and from where on they are in the
#: picture. Moduli are shown from there on too: nearer to rest they are a quotient of two numbers that vanish.
_NEAREST, _SHOWN = 1e-3, 0.08
_MOST: dict[str, Any] = {"facecolor": "#cfe3f1", "linewidth": 0.0}
_HALF: dict[str, Any] = {"facecolor": "#86b8dc", "linewidth": 0.0}
_STUDY: dict[str, Any] = {"color": "#444444", "linewidth": 0.4}
_DRAW: dict[str, Any] = {"color": page.VERMILLION, "linewidth": 0.5, "linestyle": (0, (4, 1.2))}
_MEAN: dict[str, Any] = {"color": page.BLACK, "linewidth": 1.2}


def draw_draws(model: Process, group: str | None = None, seed: int = 0) -> Any:
    """Draw mean, bands of 50 % and 95 %, some draws of each group by itself, and the studies.

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
        figure, panels = page.all_groups(model, 9.4, each=2)
        for name, (energy, modulus) in panels.items():
            _draw(energy, modulus, model, name, seed)
            energy.tick_params(labelbottom=False)
            if energy.get_subplotspec().is_first_col():
                page.label([energy], "energy [Pa]", page.SMALL)
                page.label([modulus], "secant modulus [Pa]", page.SMALL)
    views.legend(figure, _entries(), loc="outside lower center", ncols=5, fontsize=page.TEXT)
    return figure


def _draw(energy: Any, modulus: Any, model: Process, group: str, seed: int) -> None:
    low, high = page.stretches_of(model, group)
    l = page.sides(low, high, _NEAREST, _STEPS)
    bands = list(_energy(model.curve(group, l, (-page.MOST, -page.HALF, 0.0, page.HALF, page.MOST))))
    draws = [_energy(model.draw([group], l, number, seed)[0]) for number in range(_DRAWS)]
    far = np.where(l < 1.0, (1.0 - l) / (1.0 - low), (l - 1.0) / (high - 1.0)) >= _SHOWN
    # no line from one side to the other
    moduli = np.where(far, 1.0 / invariant(l), np.nan)
    for axes, scale in ((energy, np.ones_like(l)), (modulus, moduli)):
        curves = [scale * curve for curve in (*bands, *draws)]
        least, less, mean, more, most = curves[:5]
        axes.fill_between(l, least, most, **_MOST)
        axes.fill_between(l, less, more, **_HALF)
        for study in page.studies_of(model, group):
            own = np.where((l >= study.stretch[0]) & (l <= study.stretch[1]), scale, np.nan)
            curves.append(own * study.energy(l))
            axes.plot(l, curves[-1], **_STUDY)
        for draw in curves[5 : 5 + _DRAWS]:
            axes.plot(l, draw, **_DRAW)
        axes.plot(l, mean, **_MEAN)
        axes.set_xlim(low, high)
        axes.set_xticks([low, 1.0, high], labels=[f"{tick:g}" for tick in (low, 1.0, high)])
        shown = np.array(curves)[:, far]
        page.logarithmic(axes, 0.8 * np.nanmin(shown), 1.25 * np.nanmax(shown))


def _energy(log_energy: Floats) -> Floats:
    """Energy [Pa] of `y = ln(Psi + 1e-4)`; not a number where there is none of which `y` is the logarithm."""
    energy = np.exp(log_energy) - OFFSET
    return np.where(energy > 0.0, energy, np.nan)


def _entries() -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    return [
        (Line2D([], [], **_MEAN), "mean of the logarithm"),
        (Patch(**_HALF), "50 % of new studies"),
        (Patch(**_MOST), "95 %"),
        (Line2D([], [], **_DRAW), "draws"),
        (Line2D([], [], **_STUDY), "studies"),
    ]
