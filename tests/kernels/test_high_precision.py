"""Energy, stress and moduli of every law against differences of its energy in arithmetic of 60 digits."""

import numpy as np
import pytest
from material_point import MATERIALS, Point, exact, random_rotations
from verification_rows import Row

from warpbrain.kernels.module import Precision

_ROTATIONS = random_rotations(2, seed=3)


def turned(a: float, b: float, c: float) -> np.ndarray:
    """Principal stretches a, b, c in axes that are not those of the coordinates."""
    return _ROTATIONS[0] @ np.diag([a, b, c]) @ _ROTATIONS[1]


#: Distances between two stretches, from none to clearly apart: where spectral tangents break.
DELTAS = (0.0, 1e-14, 1e-12, 1e-10, 1e-8, 1e-4, 1e-2)
STATES = {
    "rest": np.eye(3),
    "rotated": _ROTATIONS[0],
    "almost rest": turned(1.0 + 1e-12, 1.0, 1.0 - 1e-12),
    "three equal": turned(1.1, 1.1, 1.1),
    "uniaxial": np.diag([0.7, 1.15, 1.15]),
    "uniaxial turned": turned(1.3, 0.9, 0.9),
    "confined": turned(0.6, 1.0, 1.0),
    "simple shear": np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    **{f"delta {d:g}": turned(1.1, 1.1 * (1.0 + d), 0.95) for d in DELTAS},
}


@pytest.mark.slow(1)
@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS.keys())
def test_against_60_digits(material, precision: Precision, device: str, verify: Row) -> None:
    F = np.stack(list(STATES.values())).astype(precision.numpy)
    point = Point(material, F, precision, device)
    density, P = point.stress()
    A = point.moduli()
    # The moduli hold products of some twenty rounded factors and powers l^alpha, whose exponents at |alpha ln l| < 7
    # cost as many roundings again.
    tolerance = 60.0 * precision.epsilon
    errors = []
    # in single precision stretches that are almost the same are
    different = {gradient.tobytes(): (i, name) for i, (gradient, name) in enumerate(zip(F, STATES, strict=True))}
    for i, name in different.values():
        psi_exact, P_exact, A_exact = exact(material, F[i], precision)
        stiffness = np.abs(A_exact).max()
        errors.append(np.abs(A[i] - A_exact).max() / stiffness)
        # where the stress is zero it is so to a rounding of the strain, that is of the moduli
        assert np.abs(P[i] - P_exact).max() <= tolerance * stiffness, name
        assert abs(density[i] - psi_exact) <= tolerance * stiffness, name
    claim = f"`dP/dF` of every law, stretches 0 to 1e-2 apart, exponents down to -20, {precision.name} precision"
    verify(claim, "differences of the energy in 60 digits (mpmath)", max(errors), tolerance)
