"""Which further test would tell two fits apart, by the log Bayes factor that is expected of it."""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.physics.values import Measurement
from warpbrain.worlds.specimen.fit import CANNOT_BE, Fit
from warpbrain.worlds.specimen.noise import noise_factor
from warpbrain.worlds.specimen.protocol import REST, Test, protocol

#: Rows of a side of a test, largest strain of one, duration [s] where no test has times, and part of a modulus that
#: differs from specimen to specimen and tells nothing.
_ROWS, _REACH, _DURATION, _SPREAD = 40, 0.5, 100.0, 0.1


def _tests(reach: float, duration: float) -> dict[str, tuple[str, Floats, Floats]]:
    """Mode, strain and time of what could be done, as far and about as long as what was done."""
    up = np.linspace(0.0, 1.0, _ROWS)
    cycle = np.concatenate([up, up[::-1][1:], -up[1:], -up[::-1][1:]])
    ramp = np.concatenate([np.linspace(0.0, 1.0, 8), np.ones(_ROWS)])
    rest = np.concatenate([np.linspace(0.0, 0.02, 8), 0.02 + np.geomspace(0.005, 1.0, _ROWS)])
    share = np.linspace(0.0, 1.0, len(cycle))
    return {
        "tension, slowly": ("axial", 1.0 + reach * up, duration * up),
        "compression, slowly": ("axial", 1.0 - reach * up, duration * up),
        "simple shear, slowly": ("shear", reach * up, duration * up),
        "torsion, slowly": ("torsion", reach * up, duration * up),
        "a compression that is held": ("axial", 1.0 - reach * ramp, duration * rest),
        "a shear that is held": ("shear", reach * ramp, duration * rest),
        "a cycle of tension and compression": ("axial", 1.0 + reach * cycle, duration * share),
        "the same cycle ten times as fast": ("axial", 1.0 + reach * cycle, 0.1 * duration * share),
        "half as much again of compression": ("axial", 1.0 - 1.5 * reach * up, duration * up),
    }


def next_measurements(one: Fit, other: Fit) -> tuple[Measurement, ...]:
    """What could be measured to tell the materials of two fits apart, what tells most first."""
    tests = one.forward.protocol.tests
    reach = min(max(test.reach for test in tests), _REACH)
    lasts = [float(np.ptp(test.time)) for test in tests if test.time is not None]
    found = []
    for what, (mode, strain, time) in _tests(reach, max(lasts, default=_DURATION)).items():
        try:
            first, second = (_stress(fit, mode, strain, time) for fit in (one, other))
        except CANNOT_BE:
            continue
        peak, away = float(np.abs(first).max()), np.abs(strain - REST[mode])
        test = Test(
            what, mode, "", True, np.arange(len(strain)), strain, first, time,
            np.concatenate([[0.0], np.cumsum(np.abs(np.diff(strain)))]) / away.max(),
            0.0, 1.0, peak, float(away.max()), np.eye(3),
        )  # fmt: skip
        model = GaussianModel(noise_factor(protocol((test,))), _SPREAD * second[:, None])
        found.append(Measurement(what, 0.5 * float(np.sum(model.standardised(first - second) ** 2))))
    return tuple(sorted(found, key=lambda one: -one.expected_nats))


def _stress(fit: Fit, mode: str, strain: Floats, time: Floats) -> Floats:
    modulus = float(np.exp(fit.forward.nuisances.logarithmic[0, 0] * fit.z[0]))
    return modulus * fit.forward.material(fit.assumed, fit.z).stress(mode, strain, time)
