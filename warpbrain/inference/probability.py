"""Probabilities in words: never higher than the share of names that were right among scored cases."""

from __future__ import annotations

from warpbrain.inference.calibration import calibration


def percent(probability: float) -> str:
    """A probability in percent; beyond `Calibration.most_said` it is only said to be beyond."""
    most = calibration().most_said
    if probability > most:
        return f"above {100.0 * most:g} %"
    if probability < 1.0 - most:
        return f"below {100.0 * (1.0 - most):g} %"
    return f"{100.0 * probability:.0f} %"
