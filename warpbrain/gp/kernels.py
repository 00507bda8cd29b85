"""Stationary kernels of unit variance over stretch, with their derivatives by the logarithm of the length scale."""

from __future__ import annotations

import math

import numpy as np

from warpbrain.arrays import Floats


def matern12(distance: Floats, length: float) -> tuple[Floats, Floats]:
    """`exp(-r)`, `r = d / length`."""
    r = distance / length
    k = np.exp(-r)
    return k, r * k


def matern32(distance: Floats, length: float) -> tuple[Floats, Floats]:
    """`(1 + r) exp(-r)`, `r = sqrt(3) d / length`: the paper's kernel."""
    r = math.sqrt(3.0) * distance / length
    decay = np.exp(-r)
    return (1.0 + r) * decay, r * r * decay


def matern52(distance: Floats, length: float) -> tuple[Floats, Floats]:
    """`(1 + r + r^2 / 3) exp(-r)`, `r = sqrt(5) d / length`."""
    r = math.sqrt(5.0) * distance / length
    decay = np.exp(-r)
    return (1.0 + r + r * r / 3.0) * decay, r * r * (1.0 + r) / 3.0 * decay


def squared_exponential(distance: Floats, length: float) -> tuple[Floats, Floats]:
    """`exp(-r^2 / 2)`, `r = d / length`."""
    r2 = (distance / length) ** 2
    k = np.exp(-0.5 * r2)
    return k, r2 * k


#: Kernels by name; each takes distances and a length scale and returns values and derivatives.
KERNELS = {
    "matern12": matern12,
    "matern32": matern32,
    "matern52": matern52,
    "squared-exponential": squared_exponential,
}
