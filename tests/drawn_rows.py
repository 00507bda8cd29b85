"""Rows drawn from a Gaussian model."""

import numpy as np
from numpy.typing import NDArray

from warpbrain.inference.gaussian import GaussianModel


def draws(model: GaussianModel, count: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Rows (n, count) of `r = U xi + kappa L eps`."""
    noise = model.noise_factor @ random.normal(size=(len(model), count))
    return np.asarray(model.scale * noise + model.columns @ random.normal(size=(model.columns.shape[1], count)))
