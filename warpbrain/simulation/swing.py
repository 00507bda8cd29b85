"""How a body swings about its rest: frequency and damping, from a motion in steps of one length.

What is followed is the momentum along one velocity `w`, that of the largest kinetic energy so far:

    p(t) = w . M v(t)

Modes are orthogonal in the mass `M`, so it is mostly of the mode that moves most, and creep, which is slow, hardly
shows. Near rest it is a sum of `a_j z_j^k` over steps k. The `z_j` are found by the matrix pencil method (Hua and
Sarkar 1990, IEEE Transactions on Acoustics, Speech and Signal Processing 38:814).

Backward Euler maps a pole `s` of `M u'' + D u' + K u = 0` to `z = 1 / (1 - h s)` at any step `h`: by that the pole is
that of the body, without what the steps damp.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats

#: A swing has been seen after so many periods, or when that part of its width is left.
PERIODS, FADED = 8, 0.01
#: Singular values that count, relative to the largest: the linear solves of steps are as exact.
_RANK = 1e-6
#: Part of a pole that is imaginary, at least, of what swings: others are rounded.
_UPRIGHT = 1e-6
#: A longer series is thinned out; the pencil compares halves of it, which tells modes apart that are nearly alike.
_LONGEST = 600


@dataclass(frozen=True)
class Swing:
    """A damped oscillation."""

    frequency: float  # of the undamped oscillation, `|s| / 2 pi` [Hz]
    damping: float  # relative to critical, `-Re s / |s|`
    damping_in_steps: float  # that of the motion as it was computed: steps of backward Euler add to it
    time_step: float  # [s]


class Momentum:
    """The momentum of a motion along its own velocity, step by step."""

    def __init__(self, masses: Floats) -> None:
        """`masses` (n,) [kg], of nodes."""
        self._masses = masses[:, None]
        self._v = self._along = np.zeros((len(masses), 3))
        self._step, self._series, self._turns = 0.0, list[float](), 0
        # `v . M v` of the velocity and `a . M a` of the acceleration, of the last step and the largest
        self._last, self._largest = np.zeros(2), np.zeros(2)

    def note(self, v: Floats, time_step: float) -> None:
        """The velocity (n, 3) [m/s] at the end of a step [s]. A step of another length begins a new series."""
        momentum, gained = self._masses * v, v - self._v
        self._last = np.array([np.sum(momentum * v), np.sum(self._masses * gained**2) / time_step**2])
        self._v = v.astype(np.float64)
        if self._last[0] > self._largest[0] or time_step != self._step:
            self._along, self._step, self._series, self._turns = self._v, time_step, [], 0
        self._largest = np.maximum(self._largest, self._last)
        self._series.append(float(np.sum(momentum * self._along)))
        self._turns += len(self._series) > 1 and self._series[-2] * self._series[-1] < 0.0

    @property
    def was_seen(self) -> bool:
        """Whether it went to and fro often enough, or neither moves much any more nor, at an end of its way, is about
        to.
        """
        faded = self._largest[0] > 0.0 and np.all(self._last <= FADED**2 * self._largest)
        return bool(faded or self._turns >= 2 * PERIODS)

    def swing(self) -> Swing | None:
        """The oscillation that has most of it; None if there is none, or it was not seen for long enough."""
        return swing_of(np.array(self._series), self._step)


def swing_of(series: Floats, time_step: float) -> Swing | None:
    """The oscillation that has most of a series (k,) of a motion in steps of backward Euler [s], None without one."""
    every = max(1, -(-len(series) // _LONGEST))
    thinned = series[::every]
    z = _poles(thinned)
    powers = z[None, :] ** np.arange(len(thinned))[:, None]
    amplitudes = np.linalg.lstsq(powers, thinned.astype(complex), rcond=None)[0]
    sizes = np.linalg.norm(powers * amplitudes, axis=0)
    in_steps = np.log(z) / (every * time_step)
    poles = (1.0 - np.exp(-in_steps * time_step)) / time_step
    swinging = poles.imag > _UPRIGHT * np.abs(poles)
    if not swinging.any():
        return None
    best = int(np.argmax(np.where(swinging, sizes, -1.0)))
    pole, in_step = poles[best], in_steps[best]
    damping, damping_in_steps = (float(-s.real / abs(s)) for s in (pole, in_step))
    return Swing(float(abs(pole)) / (2.0 * math.pi), damping, damping_in_steps, time_step)


def _poles(series: Floats) -> NDArray[np.complex128]:
    """The `z_j` of a series (k,) that is a sum of `a_j z_j^k`, those that fade."""
    from scipy.linalg import svd

    window = len(series) // 2
    if window < 2 or not series.any():
        return np.empty(0, dtype=complex)
    rows = np.lib.stride_tricks.sliding_window_view(series, window + 1)
    # of low rank, where NumPy's driver (gesdd) can fail to converge
    _, sizes, right = svd(rows, full_matrices=False, lapack_driver="gesvd")
    kept = right[sizes > _RANK * sizes[0]]
    shift = np.linalg.lstsq(kept[:, :-1].T, kept[:, 1:].T, rcond=None)[0]
    z = np.linalg.eigvals(shift).astype(complex)
    return z[(np.abs(z) > 0.0) & (np.abs(z) <= 1.0)]
