"""Pictures of scores."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from referee.intervals import share
from referee.outcomes import Outcome
from referee.scores import BINS, bin_name

#: Okabe and Ito's blue, vermilion and grey.
BLUE, VERMILION, GREY = "#0072B2", "#D55E00", "#777777"


def draw_figures(
    folder: Path,
    confused: tuple[list[str], list[str], list[list[int]]],
    calibrated: Mapping[str, Any],
    outcomes: Sequence[Outcome],
) -> None:
    """Write `confusion.png`, `reliability.png` and `accuracy.png`."""
    import matplotlib

    matplotlib.use("Agg")
    _confusion(folder / "confusion.png", *confused)
    _reliability(folder / "reliability.png", calibrated)
    _accuracy(folder / "accuracy.png", [o for o in outcomes if o.kind == "effect"])


def _confusion(file: Path, rows: list[str], columns: list[str], table: list[list[int]]) -> None:
    from matplotlib import pyplot as plt

    counts = np.array(table, dtype=float)
    parts = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    figure, axes = plt.subplots(figsize=(2.6 + 0.5 * len(columns), 1.8 + 0.32 * len(rows)), layout="constrained")
    axes.imshow(parts, cmap="Blues", vmin=0.0, vmax=1.2, aspect="auto")
    for i, j in np.argwhere(counts > 0):
        axes.text(
            j, i, f"{counts[i, j]:.0f}", ha="center", va="center", color="white" if parts[i, j] > 0.6 else "black"
        )
    axes.set_xticks(range(len(columns)), columns, rotation=45, ha="right")
    axes.set_yticks(range(len(rows)), rows)
    axes.set(xlabel="said", ylabel="true", title="Cases; darker: larger part of the row")
    figure.savefig(file, dpi=150)
    plt.close(figure)


def _reliability(file: Path, calibrated: Mapping[str, Any]) -> None:
    from matplotlib import pyplot as plt

    titles = {"all": "Every candidate after an alarm", "spoken": "Spoken names"}
    figure, both = plt.subplots(1, 2, figsize=(8.0, 4.2), layout="constrained", sharey=True)
    for axes, (key, title) in zip(both, titles.items(), strict=True):
        axes.plot([0, 1], [0, 1], color=GREY, linestyle=":", label="as stated")
        for p, right, count in calibrated[key]["rows"]:
            low, high = share([True] * round(right * count) + [False] * round((1 - right) * count)).interval
            axes.errorbar(p, right, [[max(right - low, 0.0)], [max(high - right, 0.0)]], fmt="o", color=BLUE, capsize=3)
            # beside the point on the side where there is room
            end = {"xytext": (-7, 0), "ha": "right"} if p > 0.8 else {"xytext": (7, 0), "ha": "left"}
            axes.annotate(f"{count:.0f}", (p, right), textcoords="offset points", va="center", **end)
        axes.set(xlim=(-0.05, 1.05), ylim=(-0.05, 1.05), xlabel="stated probability")
        axes.set_title(title, fontsize=10)
    both[0].set_ylabel("share that is right, of how many, with 95 % interval")
    both[0].legend(loc="upper left", frameon=False)
    figure.savefig(file, dpi=150)
    plt.close(figure)


def _accuracy(file: Path, effects: Sequence[Outcome]) -> None:
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(5.6, 3.6), layout="constrained")
    series: tuple[tuple[str, Callable[[Outcome], bool], str, str, float], ...] = (
        ("best candidate right", lambda o: o.top, BLUE, "o", -0.12),
        ("right name or group spoken", lambda o: o.held, VERMILION, "s", 0.12),
    )
    for name, test, colour, marker, aside in series:
        for k, (low, high) in enumerate(BINS):
            rated = share(test(o) for o in effects if low <= o.d < high)
            if rated.value is None:
                continue
            ends = [[rated.value - rated.interval[0]], [rated.interval[1] - rated.value]]
            label = name if k == len(BINS) - 1 else None
            axes.errorbar(k + aside, rated.value, ends, fmt=marker, color=colour, capsize=3, label=label)
    counts = [sum(low <= o.d < high for o in effects) for low, high in BINS]
    ticks = [f"{bin_name(low, high)}\n({count})" for (low, high), count in zip(BINS, counts, strict=True)]
    axes.set_xticks(range(len(BINS)), ticks)
    axes.set(ylim=(0, 1.05), xlabel="detectability of the effect (cases)", ylabel="share, with 95 % interval")
    # above the axes: intervals of few cases reach everywhere within
    figure.legend(loc="outside upper center", ncols=len(series), frameon=False)
    figure.savefig(file, dpi=150)
    plt.close(figure)
