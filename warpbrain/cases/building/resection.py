"""Anterior temporal lobe resection: which part of the template brain the surgeon takes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.building.anatomy import SYLVIAN_NORMAL, SYLVIAN_POINT

Floats = NDArray[np.float64]

# template millimetres. Posterior margin: a plane across the lobe, leaning with its axis
MARGIN_POINT = np.array([45.0, -4.5, -28.0])
LOBE_AXIS = np.array([0.0, 0.90, -0.44])
# medial margin: lateral of the uncus and the brain stem
MEDIAL = 21.0
# the upper margin is the plane of the Sylvian fissure
# corners between the margins are rounded over about this length [mm]
ROUNDING = 3.0


def anterior_temporal_lobe(points: Floats, side: str) -> Floats:
    """Field that is positive in the resected tissue.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm, template, RAS].
    side : {"left", "right"}
        Left is negative x.

    Returns
    -------
    (n,) array
        About the distance to the margin [mm].
    """
    mirrored = points * np.array([-1.0 if side == "left" else 1.0, 1.0, 1.0])
    behind = (mirrored - MARGIN_POINT) @ LOBE_AXIS
    medial = mirrored[:, 0] - MEDIAL
    below = -(mirrored - SYLVIAN_POINT) @ SYLVIAN_NORMAL
    margins = np.stack([behind, medial, below])
    # a smooth minimum: the wall of the cavity has no crease
    return np.asarray(-ROUNDING * np.logaddexp.reduce(-margins / ROUNDING, axis=0))
