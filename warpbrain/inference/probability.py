"""How a probability is said to people: never more surely than right names were counted to be right."""

from __future__ import annotations

from warpbrain.inference.calibration import calibration


def percent(probability: float) -> str:
    """A probability in percent; beyond what was counted (`Calibration.most_said`) only that it is beyond."""
    most = calibration().most_said
    if probability > most:
        return f"above {100.0 * most:g} %"
    if probability < 1.0 - most:
        return f"below {100.0 * (1.0 - most):g} %"
    return f"{100.0 * probability:.0f} %"
