"""A rigid error of registration in a fit: exact, since a small turn is no linear change of what moved far."""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.registration import moved_back, moved_back_columns, registration_of
from warpbrain.worlds.body.nuisances import Nuisances
from warpbrain.worlds.body.sensors import Sensors
from warpbrain.worlds.body.states import States


class RigidMotion:
    """The motion that recordings are taken to have been moved by, as coordinates of a fit.

    `states`: by whose motion sensors are realigned. `part`: of the coordinates.
    """

    def __init__(self, states: States, nuisances: Nuisances) -> None:
        self.part = nuisances.part("registration")
        self._deviations = registration_of(states.case).deviations
        self._realigned, self._centre = states.motion, states.centre
        # columns that explain nothing stay so (`Nuisances.weakened`)
        self._explains = bool(np.linalg.norm(nuisances.columns[:, self.part]) > 1e-6 * self._deviations.min())

    def change(self, sensors: Sensors, z: Floats) -> Floats:
        """What another motion than that of the sensors adds to their residuals (n,), at coordinates (q,)."""
        if not self._explains:
            return np.zeros(len(sensors))
        moved = moved_back(self._as_recorded(sensors), self._motion(z), self._centre) - sensors.positions
        return self._along(sensors, moved[:, :, None])[:, 0]

    def renewed(self, columns: Floats, sensors: Sensors, z: Floats) -> Floats:
        """Columns (n, q) with those of the motion about coordinates (q,)."""
        if not self._explains:
            return columns
        columns = columns.copy()
        by_motion = moved_back_columns(self._as_recorded(sensors), self._motion(z), self._centre)
        columns[:, self.part] = -self._along(sensors, by_motion) * self._deviations
        return columns

    def _motion(self, z: Floats) -> Floats:
        return np.asarray(z[self.part] * self._deviations)

    def _as_recorded(self, sensors: Sensors) -> Floats:
        """Places (n, 3) before they were realigned; NaN of forces."""
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_rotvec(self._realigned[3:]).apply(sensors.positions - self._centre)
        return np.asarray(turned + self._centre + self._realigned[:3])

    @staticmethod
    def _along(sensors: Sensors, vectors: Floats) -> Floats:
        """Components (n, k) of ways (n, 3, k) in the directions of the sensors; zero of forces."""
        rows = sensors.is_displacement
        components = np.zeros((len(sensors), vectors.shape[2]))
        components[rows] = np.einsum("nj,njk->nk", sensors.directions[rows], vectors[rows])
        return components
