"""A recorded release of the silicone beam: where its markers were held, where they came to rest, how the tip swung.

Frame of the beam: x along it from the clamp to the tip, y across, z up, a corner of the clamped face at the origin.
Recorded coordinates get into it by the rigid motion that brings the held markers onto the places that the authors
measured on the beam by hand (`target_points` of their scripts, which put them to the millimetre). Markers stand on
posts; the three at the tip tell the rigid motion of the tip, and that the way of the feet of their posts.

The tip was held by hand until its release, and hung a little lower than an undeformed beam's: of a cantilever that is
released at rest from its undeformed shape the first mode swings by

    A = 1.55 g / w^2,     1.55 = (deflection under its weight) w^2 / g of a Timoshenko beam of these proportions

whatever its modulus, and the recorded swing is smaller. `sag` is what is missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

#: Length, width, height [m]: `beam.stl`.
SIZE = np.array([0.1, 0.03, 0.03])
#: Places of the markers [m] in the frame of the beam: three of the tip, three of the clamp (published).
PLACES = np.array([0.1, 0.0, 0.0]) + 1e-3 * np.array(
    [[0, 15, 36], [0, -6, 24], [0, 36, 6], [-94, -10, -1], [-94, 40, 27.5], [-94, 40, 0.0]]
)
TIP, CLAMP = slice(0, 3), slice(3, 6)
GRAVITY = 9.81
#: `w^2` times the deflection of the tip under the beam's weight, over g: Timoshenko, clamped, length / height 10 / 3.
SWING = 1.55
#: Frames whose mean is what was held, and where it came to rest.
HELD, RESTED = 5, 100
#: A release has begun where the tip has moved by this [m]; the swing is fitted from some frames after it.
MOVED, SETTLED = 1.5e-4, 6


@dataclass(frozen=True)
class Swing:
    """The free oscillation of the middle of the tip.

    Attributes
    ----------
    frequency : float
        [Hz]
    damping : float
        Relative to critical.
    amplitude : float
        Of the vertical way at the release [m].
    creep, creep_time : float
        What part of the whole way the mean still sinks after it, and in what time [s].
    """

    frequency: float
    damping: float
    amplitude: float
    creep: float
    creep_time: float

    @property
    def sag(self) -> float:
        """How much lower than undeformed the tip was held [m], of a beam that nothing but its weight bends."""
        return SWING * GRAVITY / (2.0 * np.pi * self.frequency) ** 2 - self.amplitude


@dataclass(frozen=True, eq=False)
class Release:
    """One recording.

    Attributes
    ----------
    times : (k,) array
        [s] after the release.
    markers : (k, 6, 3) array
        Positions [m] in the frame of the beam.
    held : (6, 3) array
        Positions before the release.
    """

    times: Floats
    markers: Floats
    held: Floats

    @property
    def feet(self) -> Floats:
        """Points (6, 3) of the beam [m] nearest to the markers as held; for those of the clamp, of the clamped face."""
        feet = np.clip(self.held, 0.0, SIZE)
        feet[CLAMP, 0] = 0.0
        return feet

    def moved(self, markers: Floats, points: Floats) -> Floats:
        """Way (n, 3) [m] of points (n, 3) that move with the tip, from its markers (3, 3)."""
        R, shift = rigid_motion(self.held[TIP], markers)
        return np.asarray(points @ R.T + shift - points)

    def rested(self) -> Floats:
        """Way (6, 3) [m] of the feet to where they came to rest; of the clamp that of its markers."""
        end = self.markers[-RESTED:].mean(axis=0)
        return np.vstack([self.moved(end[TIP], self.feet[TIP]), end[CLAMP] - self.held[CLAMP]])

    def middle(self) -> Floats:
        """Way (k, 3) [m] of the middle of the tip's face."""
        point = np.array([[SIZE[0], 0.5 * SIZE[1], 0.5 * SIZE[2]]])
        return np.concatenate([self.moved(markers[TIP], point) for markers in self.markers])

    def swing(self) -> Swing:
        """An oscillation about a mean that creeps, fitted to the vertical way of the middle of the tip."""
        late = self.times >= 0.01 * SETTLED
        t, z = self.times[late], self.middle()[late, 2]

        def course(p: Floats) -> Floats:
            amplitude, start, f, zeta, end, creep, slowness = p
            w, s = 2.0 * np.pi * f, t - start
            return np.asarray(
                end
                + creep * np.exp(-s / np.exp(slowness))
                + amplitude * np.exp(-zeta * w * s) * np.cos(w * np.sqrt(1.0 - zeta**2) * s)
            )

        # the highest peak of the spectrum of what is left when the mean is taken out
        spectrum = np.abs(np.fft.rfft((z - z[-RESTED:].mean()) * np.exp(-t), 8192))
        hertz = np.fft.rfftfreq(8192, 0.01)
        first = float(hertz[np.where(hertz > 2.0, spectrum, 0.0).argmax()])
        guess = [-0.8 * z[-1], 0.0, first, 0.05, z[-1], -0.1 * z[-1], 0.0]
        fitted = least_squares(lambda p: course(p) - z, guess, x_scale=np.maximum(np.abs(guess), 1e-2)).x
        amplitude, _, frequency, damping, end, creep, slowness = fitted.tolist()
        return Swing(frequency, damping, abs(amplitude), -creep / end, float(np.exp(slowness)))


def rigid_motion(before: Floats, after: Floats) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and shift (3,) that bring points (n, 3) nearest to others."""
    a, b = before.mean(axis=0), after.mean(axis=0)
    R = Rotation.align_vectors(after - b, before - a)[0].as_matrix()
    return R, b - R @ a


def read_release(path: Path) -> Release:
    """A `.c3d` of the data set."""
    import ezc3d

    content: Any = ezc3d.c3d(str(path))
    recorded = np.asarray(content["data"]["points"][:3], dtype=np.float64).transpose(2, 1, 0)
    rate = float(content["header"]["points"]["frame_rate"])
    vertical = recorded[:, 1, 0]
    # after the first frames, in which cameras are still being switched on
    first = int(np.argmax(np.abs(vertical - np.median(vertical[20:40])) * (np.arange(len(vertical)) > 20) > MOVED))
    held = recorded[first - HELD - 1 : first - 1].mean(axis=0)
    R, shift = rigid_motion(held, PLACES)
    return Release((np.arange(len(recorded)) - first) / rate, recorded @ R.T + shift, held @ R.T + shift)
