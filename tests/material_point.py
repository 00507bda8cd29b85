"""Laws at a material point: what the kernels say there, and what arithmetic of 60 digits says."""

from functools import lru_cache

import mpmath as mp
import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.kernels.module import DOUBLE, Precision
from warpbrain.physics.laws import FORMULATIONS, Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.simulation.model import Material

Floats = NDArray[np.float64]

#: Brain-like parameters: the exponents are those of Miller and Chinzei (2002), the deal.II brain example and Budday
#: (2017), the hardest in the literature.
LAWS: dict[str, Law] = {
    "neo-hookean": NeoHookean(1000.0),
    "mooney-rivlin": MooneyRivlin(300.0, 200.0),
    "ogden -4.7": Ogden((2000.0 / -4.7,), (-4.7,)),
    "ogden -11.92": Ogden((-83.9,), (-11.92,)),
    "ogden -20": Ogden((-100.0,), (-20.0,)),
    "ogden 3 terms": Ogden((300.0, -150.0, -10.0), (2.0, -4.7, -20.0)),
}
#: Every law in every formulation.
MATERIALS = {f"{name}, {form}": Material(law, 0.45, form) for name, law in LAWS.items() for form in FORMULATIONS}


def parameter_row(material: Material) -> Floats:
    """Parameters as the kernels get them: the volumetric modulus first."""
    return np.array([material.volumetric_modulus, *material.law.parameters()])


class Point:
    """Evaluates a material's kernels at given deformation gradients, shape (k, 3, 3)."""

    def __init__(self, material: Material, F: NDArray[np.floating], precision: Precision, device: str) -> None:
        F = np.asarray(F)
        self._kernels = material.law.device_law(material.formulation).kernels(precision)
        self._precision, self._device, self._count = precision, device, len(F)
        rows = np.tile(parameter_row(material), (len(F), 1))
        self._inputs = [
            wp.array(np.arange(len(F)), dtype=int, device=device),
            wp.array(F, dtype=precision.mat33, device=device),
            wp.array(rows, dtype=precision.scalar, device=device),
        ]

    def stress(self) -> tuple[Floats, Floats]:
        """Energy density (k,) and first Piola-Kirchhoff stress (k, 3, 3)."""
        p = self._precision
        density = wp.zeros(self._count, dtype=p.scalar, device=self._device)
        P = wp.zeros(self._count, dtype=p.mat33, device=self._device)
        wp.launch(self._kernels.stress, self._count, [*self._inputs, density, P], device=self._device)
        return density.numpy().astype(float), P.numpy().astype(float)

    def moduli(self) -> Floats:
        """`A_ijkl = dP_ij/dF_kl`, shape (k, 3, 3, 3, 3)."""
        blocks = wp.zeros((self._count, 3, 3), dtype=self._precision.mat33, device=self._device)
        wp.launch(self._kernels.moduli, self._count, [*self._inputs, blocks], device=self._device)
        return blocks.numpy().astype(float).transpose(0, 3, 1, 4, 2)


def energy_at(material: Material, F: Floats, device: str = "cpu") -> Floats:
    return Point(material, F, DOUBLE, device).stress()[0]


def stress_at(material: Material, F: Floats, device: str = "cpu") -> Floats:
    return Point(material, F, DOUBLE, device).stress()[1]


def moduli_at(material: Material, F: Floats, device: str = "cpu") -> Floats:
    return Point(material, F, DOUBLE, device).moduli()


def random_rotations(count: int, seed: int = 1) -> Floats:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(count, 3, 3)))
    q *= np.sign(np.diagonal(r, axis1=1, axis2=2))[:, None, :]
    q[np.linalg.det(q) < 0] *= -1.0
    return q


def random_gradients(count: int, amount: float = 0.3, seed: int = 2) -> Floats:
    """Deformation gradients `R (I + amount E)` with uniform random `E` in [-1, 1] and random rotations."""
    rng = np.random.default_rng(seed)
    F = np.eye(3) + amount * rng.uniform(-1.0, 1.0, (4 * count, 3, 3))
    F = F[np.linalg.det(F) > 0.2][:count]
    return random_rotations(len(F), seed) @ F


# -- 60 digits: the energies written again, in principal stretches, and differenced ---------------------------------

_DIGITS = 60
#: Step of the central differences: their error is of order 1e-30, cancellation costs 30 of 60 digits.
_STEP = mp.mpf(10) ** -15


@lru_cache(maxsize=4096)
def _log_stretches(F: tuple[float, ...], moves: tuple[tuple[int, int], ...]) -> tuple[mp.mpf, mp.mpf, mp.mpf]:
    """Logarithms of the principal stretches of `F + sum of moves` (component, sign)."""
    f = [mp.mpf(v) for v in F]
    for component, sign in moves:
        f[component] += sign * _STEP
    M = mp.matrix(3, 3)
    for i in range(9):
        M[i // 3, i % 3] = f[i]
    return tuple(mp.log(w) / 2 for w in mp.eigsy(M.T * M, eigvals_only=True))


def _exact_energy(material: Material, row: list[float], logs: tuple[mp.mpf, ...]) -> mp.mpf:
    modulus, *parameters = (mp.mpf(float(v)) for v in row)
    log_J = mp.fsum(logs)
    coupled = material.formulation == "coupled"
    bar = list(logs) if coupled else [x - log_J / 3 for x in logs]

    def powers(alpha: mp.mpf) -> mp.mpf:
        return mp.fsum(mp.exp(alpha * x) for x in bar) - 3

    law = material.law
    if isinstance(law, NeoHookean):
        half_mu, none = parameters
        assert none == 0, "the second coefficient of a Mooney-Rivlin law"
        w, rest = half_mu * powers(mp.mpf(2)), 2 * half_mu
    elif isinstance(law, MooneyRivlin):
        C1, C2 = parameters
        I2 = mp.fsum(mp.exp(2 * (bar[i] + bar[j])) for i, j in ((0, 1), (0, 2), (1, 2)))
        w, rest = C1 * powers(mp.mpf(2)) + C2 * (I2 - 3), 2 * C1 + 4 * C2
    else:
        n = len(parameters) // 2
        mu, alpha = parameters[:n], parameters[n:]
        w, rest = mp.fsum(m / a * powers(a) for m, a in zip(mu, alpha, strict=True)), mp.fsum(mu)
    if coupled:
        return w - rest * log_J + modulus / 2 * log_J**2
    return w + modulus / 2 * mp.expm1(log_J) ** 2


def exact(material: Material, F: NDArray[np.floating], precision: Precision) -> tuple[float, Floats, Floats]:
    """Energy density, `P` and `dP/dF` by central differences of the energy, for the rounded `F` and parameters."""
    F = tuple(float(v) for v in np.asarray(F, dtype=precision.numpy).ravel())
    row = parameter_row(material).astype(precision.numpy).tolist()
    with mp.workdps(_DIGITS):

        def at(*moves: tuple[int, int]) -> mp.mpf:
            return _exact_energy(material, row, _log_stretches(F, moves))

        h, rest = _STEP, at()
        beside = [(at((a, 1)), at((a, -1))) for a in range(9)]
        gradient = [float((above - below) / (2 * h)) for above, below in beside]
        # h^2 times second derivatives along each component, and along the sum of two, which has them twice beside both
        bend = [above + below - 2 * rest for above, below in beside]
        hessian = np.diag([float(b / h**2) for b in bend])
        for a in range(9):
            for b in range(a):
                together = at((a, 1), (b, 1)) + at((a, -1), (b, -1)) - 2 * rest
                hessian[a, b] = hessian[b, a] = float((together - bend[a] - bend[b]) / (2 * h**2))
        return float(rest), np.reshape(gradient, (3, 3)), hessian.reshape(3, 3, 3, 3)
