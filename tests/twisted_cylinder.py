"""A cylinder between two ends that are turned against each other, by Ritz's method with polynomials.

The deformation is axisymmetric, `r = R (1 + f)`, `theta = Theta + tau Z + g`, `z = Z + h`, with polynomials `f`, `g`
and `h` in `R^2` and `Z` that vanish at the ends, of which the stored energy has its minimum. By virtual work the torque
is the derivative of that energy by `tau`, the axial force the one by the length. In an incompressible body the
polynomials are zero (Rivlin's torsion); a compressible one is wider in the middle than at its ends, where it is held.
"""

import numpy as np
from manufactured_problem import Floats, Stress
from numpy.polynomial.legendre import legder, leggauss, legvander
from numpy.typing import NDArray

#: Gauss points in each direction.
_POINTS = 24
_STEP = 1e-30


class TwistedCylinder:
    """A cylinder of radius and length 1.

    Parameters
    ----------
    stress : callable
        First Piola-Kirchhoff stress of deformation gradients, for complex numbers too.
    twist : float
        `tau` [rad] for each length.
    degree : int
        Of the polynomials, in `R^2` and in `Z`.
    """

    def __init__(self, stress: Stress, twist: float, degree: int) -> None:
        self.stress, self.twist = stress, twist
        x, w = leggauss(_POINTS)
        x, w = 0.5 * (1.0 + x), 0.5 * w
        self.R, Z = (v.ravel() for v in np.meshgrid(x, x, indexing="ij"))
        self.weight = 2.0 * np.pi * np.outer(w, w).ravel() * self.R
        across, across_slope = _basis(self.R**2, degree)
        along, along_slope = _basis(Z, degree)
        held, held_slope = Z * (1.0 - Z), 1.0 - 2.0 * Z

        def products(a: Floats, b: Floats) -> Floats:
            return np.einsum("qi,qj->qij", a, b).reshape(len(a), -1)

        bubble = held[:, None] * along
        #: Values and slopes by `R` and `Z` of the polynomials at the points.
        self.value = products(across, bubble)
        self.by_R = products(2.0 * self.R[:, None] * across_slope, bubble)
        self.by_Z = products(across, held_slope[:, None] * along + held[:, None] * along_slope)

    def _gradient(self, c: NDArray) -> NDArray:
        """`F` (q, 3, 3) in cylindrical axes."""
        f, g, h = c.reshape(3, -1)
        r = self.R * (1.0 + self.value @ f)
        F = np.zeros((len(r), 3, 3), dtype=c.dtype)
        F[:, 0, 0], F[:, 0, 2] = r / self.R + self.R * (self.by_R @ f), self.R * (self.by_Z @ f)
        F[:, 1, 0], F[:, 1, 1], F[:, 1, 2] = r * (self.by_R @ g), r / self.R, r * (self.twist + self.by_Z @ g)
        F[:, 2, 0], F[:, 2, 2] = self.by_R @ h, 1.0 + self.by_Z @ h
        return F

    def _slope(self, c: NDArray) -> NDArray:
        """Derivatives of the stored energy by the coefficients."""
        F = self._gradient(c)
        P = self.stress(F, np.zeros(3)) * self.weight[:, None, None]
        R = self.R
        # of `r` itself: in r / R, and in the two shears
        turned = P[:, 0, 0] + P[:, 1, 1] + (P[:, 1, 0] * F[:, 1, 0] + P[:, 1, 2] * F[:, 1, 2]) / F[:, 1, 1]
        r = F[:, 1, 1] * R
        by_f = turned @ self.value + (R * P[:, 0, 0]) @ self.by_R + (R * P[:, 0, 2]) @ self.by_Z
        by_g = (r * P[:, 1, 0]) @ self.by_R + (r * P[:, 1, 2]) @ self.by_Z
        by_h = P[:, 2, 0] @ self.by_R + P[:, 2, 2] @ self.by_Z
        return np.concatenate([by_f, by_g, by_h])

    def solve(self) -> tuple[float, float]:
        """Torque [N m] and axial force [N], for a unit of length of 1 m."""
        c = np.zeros(3 * self.value.shape[1])
        change = np.ones_like(c)
        while np.abs(change).max() > 1e-10:
            H = np.stack([self._slope(c + 1j * _STEP * unit).imag / _STEP for unit in np.eye(len(c))])
            # polynomials of a high degree are nearly dependent
            change = np.linalg.lstsq(H, -self._slope(c), rcond=1e-14)[0]
            c = c + change
        F = self._gradient(c)
        P = self.stress(F, np.zeros(3))
        return float(self.weight @ (P[:, 1, 2] * F[:, 1, 1] * self.R)), float(self.weight @ P[:, 2, 2])


def _basis(x: Floats, degree: int) -> tuple[Floats, Floats]:
    """Legendre polynomials on [0, 1] up to a degree, and their slopes."""
    values = legvander(2.0 * x - 1.0, degree)
    return values, 2.0 * values[:, :degree] @ legder(np.eye(degree + 1))
