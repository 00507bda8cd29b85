"""What is kept from one state to the next on each kind of device, and the solver that has a use for it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from warpbrain.simulation.coupled import CoupledSolver, LinearSolver
from warpbrain.simulation.factored import FactoredSolver, KeptFactors
from warpbrain.simulation.kept_inverse import InvertedSolver, KeptInverse, has_cupy

if TYPE_CHECKING:
    from warpbrain.simulation.system import System


def kept_for(device: Any) -> KeptFactors | None:
    """What is kept where states are solved on a Warp device; None on a GPU for which there is no CuPy."""
    if device.is_cpu:
        return KeptFactors()
    return KeptInverse(device) if has_cupy(device) else None


def with_kept(system: System, captured: LinearSolver, factors: KeptFactors, tolerance: float) -> LinearSolver:
    """A solver that is helped by what `kept_for` gave for the device of a system, or the captured one.

    On a GPU systems in single precision, and those with unknowns beside the displacement, are for that one; on any
    device those of which part is in no matrix.
    """
    if not system.assembled:
        return captured
    if not isinstance(factors, KeptInverse):
        return FactoredSolver(system, captured, factors, tolerance)
    if isinstance(captured, CoupledSolver) or system.precision.name != "double":
        return captured
    return InvertedSolver(system, captured, factors, tolerance)
