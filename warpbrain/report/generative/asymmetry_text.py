"""What a hierarchical model says of compression and tension: a table for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from warpbrain.gp.asymmetry import Asymmetry


def asymmetry_lines(found: Sequence[Asymmetry], papers: Mapping[str, tuple[float, bool]]) -> list[str]:
    """A line for each group, and one of the literature.

    Parameters
    ----------
    found : sequence of Asymmetry
    papers : mapping of str to (float, bool)
        See `warpbrain.gp.asymmetry.asymmetries_of_papers`.
    """
    width = max(len(one.group) for one in found)
    lines = [
        f"{'tension over compression, secant moduli':<{width + 20}}  mean of papers (95 % interval)   "
        "a new study (95 %)   stiffer in tension"
    ]
    for one in found:
        mean, low, high, new_low, new_high = np.exp([one.mean, one.low, one.high, one.new_low, one.new_high]).tolist()
        lines.append(
            f"{one.group:<{width + 2}}strain to {one.strain:<8.2g}  {f'{mean:.2f} ({low:.2f} to {high:.2f})':<32}"
            f"{f'{new_low:.2f} to {new_high:.2f}':<18}{100.0 * one.tension:>17.0f} %"
        )
    compression = sum(value < 0.0 for value, _ in papers.values())
    tension = sum(value > 0.0 for value, _ in papers.values())
    unable = sum(not able for _, able in papers.values())
    lines.append(
        f"of {len(papers)} hyperelastic papers {compression} are stiffer in compression, {tension} in tension; "
        f"{unable} have symmetric forms only, which say nothing of it"
    )
    return lines
