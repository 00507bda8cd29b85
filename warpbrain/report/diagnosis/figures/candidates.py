"""How probable each candidate is."""

from __future__ import annotations

from typing import Any

from warpbrain.inference.probability import percent
from warpbrain.report.diagnosis.figures.drawing import TEXT, inlined, panels
from warpbrain.report.generative.page import BLACK, BLUE, ORANGE, PALE

#: How many are drawn: those behind them are in the table.
_MOST = 10


def candidates_figure(summary: dict[str, Any]) -> str:
    """Bars of probability, and of the evidence beside it, which a probability of nearly one hides."""
    tried = [one for one in summary["ranking"] if one["log_evidence"] is not None][:_MOST]
    figure, (chances, evidence) = panels(0.8 + 0.26 * max(len(tried), 2), 2, sharey=True)
    named = {summary["mechanism"], *summary["group"]}
    for row, one in enumerate(tried):
        colour = BLUE if one["mechanism"] in named else (PALE if one["physics"] else ORANGE)
        hatch = "" if one["physics"] else "...."
        style = {"color": colour, "hatch": hatch, "edgecolor": BLACK, "linewidth": 0.5}
        chances.barh(row, one["probability"], 0.66, **style)
        evidence.barh(row, one["log_evidence"], 0.66, **style)
        inside = one["probability"] > 0.8
        chances.text(
            one["probability"],
            row,
            f"{percent(one['probability'])} " if inside else f" {percent(one['probability'])}",
            va="center",
            ha="right" if inside else "left",
            fontsize=TEXT - 1,
            color=BLACK,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0} if inside else None,
        )
    chances.set_yticks(range(len(tried)), [one["mechanism"] for one in tried], fontsize=TEXT)
    chances.set_ylim(len(tried) - 0.5, -0.5)
    chances.set_xlim(0.0, 1.0)
    evidence.axvline(0.0, color=BLACK, linewidth=0.8)
    chances.set_xlabel("probability", fontsize=TEXT)
    evidence.set_xlabel("log evidence against nothing missing", fontsize=TEXT)
    caption = (
        "Left: probability that it acts. Right: logarithm of the evidence. "
        "Blue: named, or of the group; dotted bars: no physics, or a force without a name."
    )
    most_probable = ", ".join(f"{one['mechanism']} {percent(one['probability'])}" for one in tried[:3])
    return inlined(figure, f"Probabilities of the candidates as bars: {most_probable}.", caption)
