"""A rigid error of registration: what was recorded may lie turned and shifted against the anatomy.

One motion is common to all recorded positions of a case, `x -> R(omega) (x - c) + c + t`, with `c` their mean and `R`
the rotation by the angle `|omega|` about `omega`. It is no property of the tissue: it is estimated along with it, and
integrated out of what is said of it. Turns are finite: 5 degrees at 80 mm is 0.3 mm more than its first order.
"""

import math
from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.inference.beliefs import belief
from warpbrain.recordings.base import Registration
from warpbrain.recordings.recording import PointsRecording, Recording, SurfaceRecording

#: Names of the six numbers.
NAMES = (*(f"shift {axis} [m]" for axis in "xyz"), *(f"turn about {axis} [rad]" for axis in "xyz"))


def registration_of(case: Case) -> Registration:
    """The accuracy that a case declares, or else the one that is believed (`registration.shift` and `.turn`)."""
    believed = Registration(belief("registration.shift") * case.mesh.radius, belief("registration.turn"))
    return case.registration or believed


def moved_back(positions: Floats, motion: Floats, centre: Floats) -> Floats:
    """Positions (n, 3) without a rigid motion: shift [m] and turn [rad] (6,) about a centre (3,)."""
    return (positions - centre - motion[:3]) @ _turned_back(motion).T + centre


def moved_back_columns(positions: Floats, motion: Floats, centre: Floats) -> Floats:
    """Derivatives (n, 3, 6) of `moved_back` by the motion.

    Of `R(omega)^T v` it is `[R^T v]_x J(-omega)`, with the left Jacobian `J` of the rotation group.
    """
    back = _turned_back(motion)
    columns = np.zeros((len(positions), 3, 6))
    columns[:, :, :3] = -back
    turned = (positions - centre - motion[:3]) @ back.T
    columns[:, :, 3:] = np.cross(np.eye(3), turned[:, None]) @ _left_jacobian(-motion[3:])
    return columns


def rigid_columns(positions: Floats, centre: Floats) -> Floats:
    """Derivatives (n, 3, 6) of moved positions (n, 3) by shift and turn, at no motion."""
    return -moved_back_columns(positions, np.zeros(6), centre)


def realigned(case: Case, motion: Floats, centre: Floats) -> Case:
    """The case as if its recordings had not been moved, so that points of a surface are compared with the right faces.

    `motion` (6,) is shift [m] and turn [rad] about `centre` (3,) [m].
    """
    if not motion.any():
        return case

    def moved(recording: Recording) -> Recording:
        """Forces are as they were."""
        if isinstance(recording, PointsRecording):
            positions = recording.points + recording.displacement
            return replace(recording, displacement=moved_back(positions, motion, centre) - recording.points)
        if isinstance(recording, SurfaceRecording):
            return replace(recording, points=moved_back(recording.points, motion, centre))
        return recording

    return replace(case, recordings=tuple(map(moved, case.recordings)))


def _turned_back(motion: Floats) -> Floats:
    """Matrix (3, 3) of the inverse of a motion's rotation."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(-motion[3:]).as_matrix())


def _left_jacobian(turn: Floats) -> Floats:
    """`J` with `R(w + dw) = R(J dw) R(w)` to first order (Barfoot 2017, State Estimation for Robotics, eq. 7.77)."""
    angle = float(np.linalg.norm(turn))
    K = np.cross(np.eye(3), turn)
    first, second = 0.5 - angle**2 / 24.0, 1.0 / 6.0 - angle**2 / 120.0
    # the series is exact to rounding below this
    if angle > 1e-3:
        first, second = (1.0 - math.cos(angle)) / angle**2, (angle - math.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + first * K + second * K @ K)
