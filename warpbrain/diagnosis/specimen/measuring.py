"""Which further test would tell two hypotheses apart, by the log Bayes factor that is expected of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.result import Measurement
from warpbrain.diagnosis.specimen.fitting import SpecimenFit
from warpbrain.diagnosis.specimen.forward import Forward
from warpbrain.diagnosis.specimen.material import NoStateError
from warpbrain.diagnosis.specimen.noise import noise_factor
from warpbrain.diagnosis.specimen.protocol import Test, protocol
from warpbrain.errors import InputError

Floats = NDArray[np.float64]

_ROWS = 40


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


def next_measurements(forward: Forward, one: SpecimenFit, other: SpecimenFit) -> tuple[Measurement, ...]:
    """What could be measured, what tells most first.

    Parameters
    ----------
    forward : Forward
    one, other : SpecimenFit
        Whose materials are compared; what is no mechanism of `run` is the same in both.
    """
    tests = forward.protocol.tests
    reach = min(max(float(np.abs(test.strain - test.rest).max()) for test in tests), 0.5)
    lasts = [float(np.ptp(test.time)) for test in tests if test.time is not None]
    found = []
    for what, (mode, strain, time) in _tests(reach, max(lasts, default=100.0)).items():
        try:
            stresses = [_stress(forward, fit, mode, strain, time) for fit in (one, other)]
        except (InputError, NoStateError):
            continue
        test = Test(what, mode, "", True, strain, stresses[0], time, 0.0, 1.0)
        factor = noise_factor(protocol((test,)))
        white = np.linalg.solve(factor, np.column_stack([stresses[0] - stresses[1], stresses[1]]))
        # a modulus that differs by a tenth from specimen to specimen tells nothing
        across, along = white[:, 0], 0.1 * white[:, 1]
        squared = float(across @ across - (across @ along) ** 2 / (1.0 + along @ along))
        found.append(Measurement(what, 0.5 * squared))
    return tuple(sorted(found, key=lambda one: -one.expected_nats))


def _stress(forward: Forward, fit: SpecimenFit, mode: str, strain: Floats, time: Floats) -> Floats:
    nuisances = forward.nuisances(fit.hypothesis)
    logs = nuisances.split(fit.z)[0]
    scale = float(
        np.exp(nuisances.logarithmic[:, 0] @ np.ones(len(forward.protocol)) / len(forward.protocol) * logs[0])
    )
    return scale * forward.material(fit.hypothesis, fit.z).stress(mode, strain, time)
