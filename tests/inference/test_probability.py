"""What is printed of a probability never says more than was counted."""

import numpy as np
import pytest

from warpbrain.inference.calibration import calibration, percent


@pytest.mark.parametrize(("probability", "said"), [(0.5, "50 %"), (0.934, "93 %"), (0.066, "7 %")])
def test_percent(probability, said):
    assert percent(probability) == said


def test_nothing_is_said_to_be_surer_than_was_counted():
    most = calibration().most_said
    assert 0.5 < most < 0.99
    for probability in np.linspace(0.0, 1.0, 1001):
        said = percent(probability)
        stated = float(said.split()[-2])
        assert 100.0 * (1.0 - most) - 1e-9 <= stated <= 100.0 * most + 1e-9
        assert said.startswith("above") == (probability > most)
        assert said.startswith("below") == (probability < 1.0 - most)
