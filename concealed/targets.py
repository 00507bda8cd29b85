"""How far the walls of each case are to have moved: spread about the published medians."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from concealed.published import MEDIANS, NAMES

#: Standard deviation of the logarithm over the cases.
SPREAD = 0.27


def draw_targets(seed: int) -> dict[str, tuple[float, float]]:
    """Wanted root mean square motion [m] of ventricles and cavity in each case.

    Log-normal with one draw from each eighth of the distribution, in random order and apart for the two walls; then
    scaled so that the medians over the eight are the published ones.
    """
    random = np.random.default_rng(seed)
    columns = []
    for median in MEDIANS:
        share = (np.arange(len(NAMES)) + random.uniform(0.2, 0.8, len(NAMES))) / len(NAMES)
        motion = np.exp(SPREAD * ndtri(random.permutation(share)))
        columns.append(1e-3 * median * motion / np.median(motion))
    return {name: (float(v), float(c)) for name, v, c in zip(NAMES, *columns, strict=True)}
