"""Noise of which nothing is declared, found beside nuisances and a smooth force: a block whose noise is known."""

from dataclasses import replace

import numpy as np
from sinking_block import write_sinking

from warpbrain.estimation.options import Listener
from warpbrain.worlds.body.base import BaseFinder
from warpbrain.worlds.body.states import States


def test_noise_that_is_not_declared(tmp_path, verify):
    case = write_sinking(tmp_path / "case")
    [recording] = [one for one in case.recordings if one.role == "fit"]
    moved = recording.displacement.copy()
    # no noise explains a few points that are off by a centimetre
    moved[::40] += 0.01
    unknown = replace(recording, sigma=None, displacement=moved)
    base = BaseFinder(States(replace(case, recordings=(unknown,)), "cpu"), 0.01, False, False, Listener()).find()
    verify(
        "standard deviation of an undeclared noise of a body that sinks unsaid, gross errors among its points",
        "standard deviation with which it was drawn",
        float(np.abs(base.noise / recording.sigma - 1.0).max()),
        0.15,
    )
