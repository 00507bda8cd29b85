"""Rigid motions of what is recorded, made with SciPy's rotations."""

import numpy as np
from scipy.spatial.transform import Rotation


def moved(positions: np.ndarray, motion: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Positions (n, 3) after a rigid motion: shift [m] and turn [rad] (6,) about a centre (3,)."""
    return Rotation.from_rotvec(motion[3:]).apply(positions - centre) + centre + motion[:3]
