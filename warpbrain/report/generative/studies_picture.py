"""The published strain energies as curves, in the spirit of the supplement's Fig. 1."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.gp.literature.study import Study
from warpbrain.gp.process import Process
from warpbrain.report.generative import page

_COLOURS = (page.BLUE, page.VERMILLION, page.GREEN, page.BLACK, page.PURPLE, page.ORANGE)
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))
#: Energies are shown down to those at this part of the way from rest to the end of the range: they vanish at rest.
_SHOWN = 0.08
#: Curves begin at this part of it, where they are below the picture.
_NEAREST = 1e-3
#: Letters of what is written beside a curve: in a picture of a single group, and in a panel of many.
_LONG, _SHORT = 38, 12


def draw_studies(model: Process, group: str | None = None) -> Any:
    """Draw what a model learnt from.

    Studies are called by their number in the paper's Table 1, and by their names where there is room; those that the
    user added have a name only.

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
        _draw(axes, studies, _limits(studies), [_long_name(study) for study in studies], page.TEXT)
        page.label([axes], "strain energy [Pa]", page.TEXT + 1)
        return figure
    figure, panels = page.all_groups(model, 6.8)
    for name, [axes] in panels.items():
        method = name.split("/")[0]
        row = [study for study in model.studies if study.group.split("/")[0] == method]
        studies = page.studies_of(model, name)
        # one scale a row, so that its groups can be compared
        _draw(axes, studies, _limits(row), [_short_name(study) for study in studies], page.SMALL - 1.0)
        if axes.get_subplotspec().is_first_col():
            page.label([axes], "strain energy [Pa]")
    figure.supxlabel("numbers: n in Table 1 of the paper's supplement", fontsize=page.SMALL, color=page.QUIET)
    return figure


def _draw(axes: Any, studies: Sequence[Study], limits: tuple[float, float], names: Sequence[str], size: float) -> None:
    low = min(study.stretch[0] for study in studies)
    high = max(study.stretch[1] for study in studies)
    ends = []
    for index, (study, name) in enumerate(zip(studies, names, strict=True)):
        l = page.sides(*study.stretch, _NEAREST, 150)
        energies = study.energy(l)
        style = {"color": _COLOURS[index % len(_COLOURS)], "linestyle": _DASHES[index // len(_COLOURS) % len(_DASHES)]}
        axes.plot(l, energies, linewidth=0.9, **style)
        ends.append((study.stretch[1], float(energies[-1]), name, style["color"]))
    page.logarithmic(axes, *limits)
    axes.set_xlim(low, high)
    axes.set_xticks([low, 1.0, high], labels=[f"{tick:g}" for tick in (low, 1.0, high)])
    _write_names(axes, ends, size, high + 0.08 * (high - low), limits)


def _write_names(
    axes: Any, ends: Sequence[tuple[float, float, str, str]], size: float, place: float, limits: tuple[float, float]
) -> None:
    """Write what curves are called to the right of the panel, moved apart where they would overlap."""
    # a panel is about this high [point], what the layout leaves of the figure
    rows = axes.get_subplotspec().get_gridspec().nrows
    height = 0.72 * axes.get_figure().get_figheight() * 72.0 / rows
    low, high = np.log(limits)
    order = sorted(ends, key=lambda end: end[1])
    at = _moved_apart((np.log([end[1] for end in order]) - low) / (high - low), 1.15 * size / height)
    for (stretch, energy, name, colour), y in zip(order, np.exp(low + (high - low) * at), strict=True):
        axes.plot([stretch, place], [energy, y], color=page.PALE, linewidth=0.4, zorder=0, clip_on=False)
        axes.text(place, y, name, fontsize=size, color=colour, ha="left", va="center", parse_math=False)


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
        nearest.append(study.energy(1.0 + _SHOWN * (ends - 1.0)).min())
        farthest.append(study.energy(ends).max())
    return 0.7 * float(np.min(nearest)), 1.6 * float(np.max(farthest))


def _long_name(study: Study) -> str:
    return _cut(study.name if study.number is None else f"{study.number}  {study.name}", _LONG)


def _short_name(study: Study) -> str:
    return _cut(study.name, _SHORT) if study.number is None else str(study.number)


def _cut(text: str, length: int) -> str:
    """A text on one line, of so many letters at most."""
    text = " ".join(text.split())
    return text if len(text) <= length else text[: length - 1] + "…"
