"""Pictures of the generative model of tissue, a panel for each group of studies: studies, extrapolation, draws.

Colours are Okabe and Ito's, which the colour-blind tell apart; what has a colour has a line style, a shade or a hatch
of its own too, so that a print in grey says the same.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.gp.literature.study import ANATOMIES, METHODS, OFFSET, Study, invariant
from warpbrain.gp.process import Process
from warpbrain.report import views
from warpbrain.report.views import BLACK, BLUE, GREEN, ORANGE, PURPLE, QUIET, SKY, VERMILLION

#: Width of a picture [inch], two columns of a journal; size of texts [point]; pixels of print, 300 an inch.
_WIDTH, _TEXT, _SMALL = 7.2, 7.0, 6.0
_PALE, _GROUND = "#bbbbbb", "#eeeeee"
save = partial(views.save, dpi=300)
#: Half the widths of the bands that hold 50 % and 95 % of new studies [standard deviations].
HALF, MOST = 0.674490, 1.959964
#: Parts of the way from rest to the end of the range: where curves begin, and from where on energies are in the picture
#: (they vanish at rest, where a modulus is a quotient of two numbers that vanish).
_NEAREST, _SHOWN = 1e-3, 0.08
_ENERGY = "strain energy [Pa]"

# studies
_COLOURS = (BLUE, VERMILLION, GREEN, BLACK, PURPLE, ORANGE)
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))
#: Letters of what is written beside a curve: in a picture of a single group, and in a panel of many.
_LONG, _SHORT = 38, 12

# extrapolation: stretches that are shown, and energies [Pa]: bands that leave these are wider than the picture
_STRETCHES = np.linspace(0.5, 1.5, 251)
_ENERGIES = (1e-5, 1e7)
_THIN: dict[str, Any] = {"color": BLACK, "linewidth": 0.4}
_BAND: dict[str, Any] = {"facecolor": SKY, "alpha": 0.55, "linewidth": 0.0}
_MEAN: dict[str, Any] = {"color": BLUE, "linewidth": 1.3}
_OTHER_BAND: dict[str, Any] = {"facecolor": "none", "edgecolor": ORANGE, "hatch": "////", "linewidth": 0.0}
_OTHER_MEAN: dict[str, Any] = {"color": VERMILLION, "linewidth": 1.0, "linestyle": (0, (4, 1.2))}

# draws; steps to each side of rest: bands of the paper's process widen between any two of its hundred points a study
_DRAWS, _STEPS = 16, 160
_95: dict[str, Any] = {"facecolor": "#cfe3f1", "linewidth": 0.0}
_50: dict[str, Any] = {"facecolor": "#86b8dc", "linewidth": 0.0}
_STUDY: dict[str, Any] = {"color": "#444444", "linewidth": 0.4}
_DRAW: dict[str, Any] = {"color": VERMILLION, "linewidth": 0.5, "linestyle": (0, (4, 1.2))}
_MIDDLE: dict[str, Any] = {"color": BLACK, "linewidth": 1.2}


def draw_studies(model: Process, group: str | None = None) -> Any:
    """The published energies that a model learnt from, in the spirit of the supplement's Fig. 1; `group`: only this.

    Studies are called by their number in the paper's Table 1, and by their names where there is room; those that the
    user added have a name only.
    """

    def draw(name: str, studies: Sequence[Study], axes: Any) -> None:
        if group is not None:
            names = [_cut(s.name if s.number is None else f"{s.number}  {s.name}", _LONG) for s in studies]
            _draw_studies(axes, studies, studies, names, _TEXT)
            return
        # one scale a row, so that its groups can be compared
        row = [study for study in model.studies if study.group.split("/")[0] == name.split("/")[0]]
        names = [_cut(s.name, _SHORT) if s.number is None else str(s.number) for s in studies]
        _draw_studies(axes, studies, row, names, _SMALL - 1.0)

    figure = _groups(model, group, 6.8, draw, [_ENERGY])
    if group is None:
        figure.supxlabel("numbers: n in Table 1 of the paper's supplement", fontsize=_SMALL, color=QUIET)
    return figure


def draw_extrapolation(model: Process, other: Process, group: str | None = None) -> Any:
    """Mean and band of 95 % far beyond the studies, another model behind: in the spirit of the supplement's Fig. 4."""

    def curves(process: Process, name: str) -> list[Floats]:
        # a band may be hundreds of decades wide
        return list(np.exp(np.clip(process.curve(name, _STRETCHES, (-MOST, 0.0, MOST)), -500.0, 500.0)))

    def draw(name: str, studies: Sequence[Study], axes: Any) -> None:
        axes.axvspan(*_stretches_of(studies), color=_GROUND, linewidth=0.0, zorder=0)
        if name in other.groups:
            low, mean, high = curves(other, name)
            axes.fill_between(_STRETCHES, low, high, zorder=1, **_OTHER_BAND)
            for edge in (low, high):
                axes.plot(_STRETCHES, edge, color=ORANGE, linewidth=0.6, zorder=2)
            axes.plot(_STRETCHES, mean, zorder=4, **_OTHER_MEAN)
        low, mean, high = curves(model, name)
        axes.fill_between(_STRETCHES, low, high, zorder=3, **_BAND)
        axes.plot(_STRETCHES, mean, zorder=5, **_MEAN)
        for study in studies:
            at = np.linspace(*study.stretch, 101)
            axes.plot(at, study.energy(at) + OFFSET, zorder=6, **_THIN)
        axes.set_xlim(_STRETCHES[0], _STRETCHES[-1])
        axes.set_xticks([_STRETCHES[0], 1.0, _STRETCHES[-1]])
        logarithmic(axes, *_ENERGIES)

    figure = _groups(model, group, 6.2, draw, [f"strain energy + {OFFSET:g} [Pa]"])
    names = [f"{process.name}, {process.variant}" for process in (model, other)]
    entries = [
        (views.line(**_THIN), "studies"),
        (views.patch(facecolor=_GROUND), "stretches of these"),
        (views.line(**_MEAN), f"{names[0]}: mean"),
        (views.patch(**_BAND), "its 95 %"),
        (views.line(**_OTHER_MEAN), f"{names[1]}: mean"),
        (views.patch(**{**_OTHER_BAND, "linewidth": 0.6}), "its 95 %"),
    ]
    views.legend(figure, entries, loc="outside lower center", ncols=3, fontsize=_TEXT)
    return figure


def draw_draws(model: Process, group: str | None = None, seed: int = 0) -> Any:
    """Mean, bands of 50 % and 95 %, draws and studies as energy and as secant modulus: the supplement's Fig. 5."""

    def energies(log_energy: Floats) -> Floats:
        """Of `y = ln(Psi + 1e-4)` [Pa]; not a number where there is none of which `y` is the logarithm."""
        energy = np.exp(log_energy) - OFFSET
        return np.where(energy > 0.0, energy, np.nan)

    def draw(name: str, studies: Sequence[Study], energy: Any, modulus: Any) -> None:
        low, high = _stretches_of(studies)
        l = _sides(low, high, _STEPS)
        bands = list(energies(model.curve(name, l, (-MOST, -HALF, 0.0, HALF, MOST))))
        draws = [energies(model.draw([name], l, number, seed)[0]) for number in range(_DRAWS)]
        far = np.where(l < 1.0, (1.0 - l) / (1.0 - low), (l - 1.0) / (high - 1.0)) >= _SHOWN
        # no line from one side to the other
        moduli = np.where(far, 1.0 / invariant(l), np.nan)
        for axes, scale in ((energy, np.ones_like(l)), (modulus, moduli)):
            curves = [scale * curve for curve in (*bands, *draws)]
            least, less, mean, more, most = curves[:5]
            axes.fill_between(l, least, most, **_95)
            axes.fill_between(l, less, more, **_50)
            for study in studies:
                inside = np.where((l >= study.stretch[0]) & (l <= study.stretch[1]), scale, np.nan)
                curves.append(inside * study.energy(l))
                axes.plot(l, curves[-1], **_STUDY)
            for drawn in curves[5 : 5 + _DRAWS]:
                axes.plot(l, drawn, **_DRAW)
            axes.plot(l, mean, **_MIDDLE)
            _ticks(axes, low, high)
            shown = np.array(curves)[:, far]
            logarithmic(axes, 0.8 * np.nanmin(shown), 1.25 * np.nanmax(shown))
        if group is None:
            energy.tick_params(labelbottom=False)

    names = ["energy [Pa]", "secant modulus [Pa]"] if group is None else [_ENERGY, "secant shear modulus [Pa]"]
    figure = _groups(model, group, 9.4, draw, names, _SMALL)
    entries = [
        (views.line(**_MIDDLE), "mean of the logarithm"),
        (views.patch(**_50), "50 % of new studies"),
        (views.patch(**_95), "95 %"),
        (views.line(**_DRAW), "draws"),
        (views.line(**_STUDY), "studies"),
    ]
    views.legend(figure, entries, loc="outside lower center", ncols=5, fontsize=_TEXT)
    return figure


def _groups(
    model: Process,
    group: str | None,
    height: float,
    draw: Callable[..., None],
    names: Sequence[str],
    size: float = _TEXT,
) -> Any:
    """A figure that `draw(group, its studies, *panels)` fills, with a panel a group for each vertical axis: those of
    one group side by side, or a row of panels for every method and a column for every anatomy, `height` inches high."""
    from matplotlib.figure import Figure

    studies = {name: [study for study in model.studies if study.group == name] for name in model.groups}
    if group is not None:
        figure = Figure(figsize=(_WIDTH, 3.6), layout="constrained")
        panels = list(figure.subplots(1, len(names), squeeze=False)[0])
        figure.suptitle(group, fontsize=_TEXT + 2)
        draw(group, studies[group], *panels)
        for axes, name in zip(panels, names, strict=True):
            axes.tick_params(labelsize=_TEXT)
            axes.set_xlabel("stretch", fontsize=_TEXT + 1)
            axes.set_ylabel(name, fontsize=_TEXT + 1)
        return figure
    figure, each = Figure(figsize=(_WIDTH, height), layout="constrained"), len(names)
    grid = figure.subplots(each * len(METHODS), len(ANATOMIES), squeeze=False)
    for row, method in enumerate(METHODS):
        for column, anatomy in enumerate(ANATOMIES):
            known = f"{method}/{anatomy}"
            stack = list(grid[each * row : each * (row + 1), column])
            stack[0].set_title(known, fontsize=_TEXT)
            if known not in model.groups:
                for axes in stack:
                    axes.set_xticks([])
                    axes.set_yticks([])
                    axes.spines[:].set_color(_PALE)
                    axes.text(0.5, 0.5, "no study", fontsize=_TEXT, ha="center", va="center", transform=axes.transAxes)
                continue
            for axes in stack:
                axes.tick_params(labelsize=_SMALL, length=2.5)
            draw(known, studies[known], *stack)
            if row == len(METHODS) - 1:
                stack[-1].set_xlabel("stretch", fontsize=_TEXT)
            for axes, name in zip(stack, names, strict=True):
                if column == 0:
                    axes.set_ylabel(name, fontsize=size)
    return figure


def _stretches_of(studies: Sequence[Study]) -> tuple[float, float]:
    """The stretches (low, high) that studies speak for, all together."""
    return min(study.stretch[0] for study in studies), max(study.stretch[1] for study in studies)


def _draw_studies(
    axes: Any, studies: Sequence[Study], scale_of: Sequence[Study], names: Sequence[str], size: float
) -> None:
    """Energies of studies with their names beside them, on the scale on which others are shown, too."""
    low, high = _stretches_of(studies)
    shown = [(study, np.array(study.stretch)) for study in scale_of]
    nearest = min(float(study.energy(1.0 + _SHOWN * (end - 1.0)).min()) for study, end in shown)
    limits = 0.7 * nearest, 1.6 * max(float(study.energy(end).max()) for study, end in shown)
    ends = []
    for index, (study, name) in enumerate(zip(studies, names, strict=True)):
        l = _sides(*study.stretch, 150)
        energies = study.energy(l)
        style = {"color": _COLOURS[index % len(_COLOURS)], "linestyle": _DASHES[index // len(_COLOURS) % len(_DASHES)]}
        axes.plot(l, energies, linewidth=0.9, **style)
        ends.append((study.stretch[1], float(energies[-1]), name, style["color"]))
    logarithmic(axes, *limits)
    _ticks(axes, low, high)
    # names stand to the right of the panel, moved apart where they would overlap; a panel is about this high [point],
    # what the layout leaves of the figure
    rows = axes.get_subplotspec().get_gridspec().nrows
    height = 0.72 * axes.get_figure().get_figheight() * 72.0 / rows
    (bottom, top), place = np.log(limits), high + 0.08 * (high - low)
    ends.sort(key=lambda end: end[1])
    at = _moved_apart((np.log([end[1] for end in ends]) - bottom) / (top - bottom), 1.15 * size / height)
    for (stretch, energy, name, colour), y in zip(ends, np.exp(bottom + (top - bottom) * at), strict=True):
        axes.plot([stretch, place], [energy, y], color=_PALE, linewidth=0.4, zorder=0, clip_on=False)
        axes.text(place, y, name, fontsize=size, color=colour, ha="left", va="center", parse_math=False)


def _moved_apart(places: Floats, apart: float) -> Floats:
    """Rising places in [0, 1], moved as little as a few sweeps find, so that neighbours are some way apart."""
    apart = min(apart, 1.0 / max(len(places), 1))
    moved = places.copy()
    for _ in range(200):
        lack = np.maximum(apart - np.diff(moved), 0.0)
        if not lack.size or lack.max() < 1e-4:
            break
        moved[:-1] -= 0.5 * lack
        moved[1:] += 0.5 * lack
        moved = np.clip(moved, 0.5 * apart, 1.0 - 0.5 * apart)
    return moved


def _cut(text: str, length: int) -> str:
    """A text on one line, of so many letters at most."""
    text = " ".join(text.split())
    return text if len(text) <= length else text[: length - 1] + "…"


def _ticks(axes: Any, low: float, high: float) -> None:
    axes.set_xlim(low, high)
    axes.set_xticks([low, 1.0, high], labels=[f"{tick:g}" for tick in (low, 1.0, high)])


def _sides(low: float, high: float, count: int) -> Floats:
    """Stretches on both sides of rest to these ends, in `count` equal steps a side, more close to rest."""
    step = 1.0 / count
    part = np.concatenate([np.geomspace(_NEAREST, step, 12)[:-1], np.linspace(step, 1.0, count)])
    return np.concatenate([1.0 + (low - 1.0) * part[::-1], 1.0 + (high - 1.0) * part])


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
