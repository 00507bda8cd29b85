"""Which samples a load is likely to be too much for, before any of them is computed: a linear estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.ensemble.sample import Sample
from warpbrain.errors import SolveError
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Model
from warpbrain.simulation.system import System

#: How exact the estimate has to be: it decides on a sign.
_TOLERANCE = 1e-2


def least_stretch(model: Model, device: str | None = None) -> float:
    """The least principal stretch of any element in linear elasticity; below zero no tissue is left of one.

    ``min eig(I + (H + H^T) / 2)`` with the displacement gradient H of the body under its full load, with the stiffness
    that it has at rest. A body stiffens as it is compressed, so it may bear what this says it does not. Errors are
    those of `EquilibriumSolver.linear_estimate`.
    """
    system = System(model, device)
    solver = EquilibriumSolver(system, EquilibriumOptions(cg_tolerance=_TOLERANCE))
    system.u.assign(solver.linear_estimate())
    F = system.deformation_gradients()
    return float(np.linalg.eigvalsh(0.5 * (F + F.transpose(0, 2, 1))).min())


@dataclass(frozen=True)
class Overload:
    """Samples that are too soft for the load, by `least_stretch`."""

    numbers: tuple[int, ...]
    #: Part of the load that leaves some tissue of every element of the softest one, in that estimate; 1 if none is too
    #: soft, nan if it has no linear estimate
    share: float


def overloaded(model: Model, samples: Sequence[Sample], device: str | None = None) -> Overload:
    """Samples that are too soft for the load, and what part of it all of them bear.

    Samples are taken in the order of their stiffness and the first that bears the load is found by bisection: a few
    linear solves, however many samples there are. `InputError` as of `least_stretch`.
    """

    def stiffness(sample: Sample) -> float:
        """Mean logarithm of the shear moduli [Pa]."""
        return float(np.mean([np.log(one.law.shear_modulus) for one in (sample.materials or {}).values()]))

    ordered = sorted((sample for sample in samples if sample.materials is not None), key=stiffness)

    def stretch_of(sample: Sample) -> float:
        assert sample.materials is not None
        try:
            return least_stretch(replace(model, materials=sample.materials), device)
        except SolveError:
            return float("nan")

    first, last = 0, len(ordered)
    while first < last:
        middle = (first + last) // 2
        first, last = (first, middle) if stretch_of(ordered[middle]) > 0.0 else (middle + 1, last)
    # the stretch is one less what grows with the load
    share = 1.0 / (1.0 - stretch_of(ordered[0])) if first else 1.0
    return Overload(tuple(sorted(sample.number for sample in ordered[:first])), share)
