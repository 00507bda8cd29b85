"""The published strain energies as curves, in the spirit of the supplement's Fig. 1."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.gp.literature.study import Study
from warpbrain.gp.process import Process
from warpbrain.report.generative import page

Floats = NDArray[np.float64]

_COLOURS = (page.BLUE, page.VERMILLION, page.GREEN, page.BLACK, page.PURPLE, page.ORANGE)
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))
#: Energies are shown down to those at this part of the way from rest to the end of the range: they vanish at rest.
_NEAREST = 0.08


def draw_studies(model: Process, group: str | None = None) -> Any:
    """Draw what a model learnt from.

    Parameters
    ----------
    model : Process
    group : str, optional
        Only this one, in a larger panel.

    Returns
    -------
    matplotlib.figure.Figure
    """
    if group is not None:
        figure, [axes] = page.one_group(group)
        studies = page.studies_of(model, group)
        _draw(axes, studies, _limits(studies), page.TEXT)
        axes.set_xlabel("stretch", fontsize=page.TEXT + 1)
        page.label([axes], "strain energy [Pa]", page.TEXT + 1)
    else:
        figure, panels = page.all_groups(model, 6.6)
        for name, [axes] in panels.items():
            method = name.split("/")[0]
            row = [study for study in model.studies if study.group.split("/")[0] == method]
            # one scale a row, so that its groups can be compared
            _draw(axes, page.studies_of(model, name), _limits(row), page.SMALL - 1.5)
        figure.supxlabel("stretch", fontsize=page.TEXT + 1)
        figure.supylabel("strain energy [Pa]", fontsize=page.TEXT + 1)
    return figure


def _draw(axes: Any, studies: Sequence[Study], limits: tuple[float, float], size: float) -> None:
    low = min(study.stretch[0] for study in studies)
    high = max(study.stretch[1] for study in studies)
    ends = []
    for index, study in enumerate(studies):
        l = np.linspace(*study.stretch, 301)
        l = l[np.abs(l - 1.0) > 1e-6]
        energies = study.energy(l)
        style = {"color": _colour(index), "linestyle": _DASHES[index // len(_COLOURS) % len(_DASHES)]}
        axes.plot(l, energies, linewidth=0.8, **style)
        # a study that the user added has no number: its name says more
        text = study.name if study.number is None else str(study.number)
        ends.append((study.stretch[1], float(energies[-1]), text, style["color"]))
    page.decades(axes, *limits)
    # room for the numbers
    room = 0.07 if len(ends) > 1 else 0.05
    longest = max(len(text) for _, _, text, _ in ends)
    axes.set_xlim(low - 0.02 * (high - low), high + max(room, 0.03 * longest) * (high - low) + room * (high - low))
    axes.set_xticks([low, 1.0, high], labels=[f"{tick:g}" for tick in (low, 1.0, high)])
    _write_numbers(axes, ends, size, high + 0.07 * (high - low), limits)


def _write_numbers(
    axes: Any, ends: Sequence[tuple[float, float, str, str]], size: float, place: float, limits: tuple[float, float]
) -> None:
    """Write what curves are called beside their ends, moved apart where they would overlap."""
    height = axes.get_figure().get_figheight() * 72.0 / (3.7 if size < page.TEXT else 1.3)
    apart = 1.15 * size / height
    low, high = np.log(limits)
    order = sorted(ends, key=lambda end: end[1])
    at = _moved_apart((np.log([end[1] for end in order]) - low) / (high - low), apart)
    for (stretch, energy, text, colour), y in zip(order, np.exp(low + (high - low) * at), strict=True):
        axes.plot([stretch, place], [energy, y], color=page.PALE, linewidth=0.4, zorder=0)
        axes.text(place, y, text, fontsize=size, color=colour, ha="left", va="center", parse_math=False)


def _moved_apart(places: Floats, apart: float) -> Floats:
    """Rising places in [0, 1], moved as little as a few sweeps find, so that neighbours are some way apart."""
    apart = min(apart, 1.0 / max(len(places), 1))
    moved = places.copy()
    for _ in range(200):
        gaps = np.diff(moved)
        lack = np.maximum(apart - gaps, 0.0)
        if not lack.size or lack.max() < 1e-4:
            break
        moved[:-1] -= 0.5 * lack
        moved[1:] += 0.5 * lack
        moved = np.clip(moved, 0.5 * apart, 1.0 - 0.5 * apart)
    return moved


def _limits(studies: Sequence[Study]) -> tuple[float, float]:
    """Energies (low, high) [Pa] that are shown of studies."""
    nearest, farthest = [], []
    for study in studies:
        ends = np.array(study.stretch)
        nearest.append(study.energy(1.0 + _NEAREST * (ends - 1.0)).min())
        farthest.append(study.energy(ends).max())
    return 0.7 * float(np.min(nearest)), 1.6 * float(np.max(farthest))


def _colour(index: int) -> str:
    return _COLOURS[index % len(_COLOURS)]
