"""Tissue of the truth: moduli from the generative model's range, a law the tool does not assume, a random field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from concealed.body import Body, Floats
from concealed.grown_ogden import GrownOgden
from warpbrain.simulation.model import Material

#: Shear modulus [Pa] of the generative model's hyperelastic grey and white matter at k = -2, 0 and 2.
RANGES = {"grey": (532.1, 1115.65, 2334.15), "white": (316.59, 619.64, 1212.35)}
#: Waves of the random field.
WAVES = 80
#: Stiffness and growth are realised in steps: of the logarithm of stiffness, and of relative volume.
STIFFNESS_STEP = 0.04
GROWTH_STEP = 0.004


@dataclass(frozen=True, kw_only=True)
class Tissue:
    """Tissue of one case.

    Parameters
    ----------
    k_grey, k_white : float
        Where in the generative model's range, in its standard deviations, -2 to 2.
    alpha : (float, float)
        Exponents of the two Ogden terms.
    share : float
        Share of the first term in the shear modulus, 0 to 1.
    poisson : float
    field_sd, field_length : float
        Of the random field of the logarithm of stiffness: standard deviation, and length over which it changes [m].
    field_seed : int
    """

    k_grey: float
    k_white: float
    alpha: tuple[float, float]
    share: float
    poisson: float
    field_sd: float
    field_length: float
    field_seed: int

    def moduli(self) -> dict[int, float]:
        """Shear modulus [Pa] of grey (1) and white (2) matter before the field."""
        return {1: _modulus("grey", self.k_grey), 2: _modulus("white", self.k_white)}

    def field(self, points: Floats) -> Floats:
        """Random field at points (n, 3) [m]: shape (n,), about normal with `field_sd`."""
        random = np.random.default_rng(self.field_seed)
        wave = random.normal(size=(WAVES, 3)) / self.field_length
        phase = 2.0 * np.pi * random.random(WAVES)
        return self.field_sd * np.sqrt(2.0 / WAVES) * np.cos(points @ wave.T + phase).sum(axis=1)

    def materials(
        self, body: Body, log_stiffness: Floats, growth: Floats
    ) -> tuple[NDArray[np.int32], dict[int, Material]]:
        """A label for each tetrahedron (m,), and the material of each label.

        Parameters
        ----------
        body : Body
        log_stiffness : (m,) array
            What effects add to the random field.
        growth : (m,) array
            Relative growth of volume.
        """
        stiffer = np.round((self.field(body.centroids) + log_stiffness) / STIFFNESS_STEP).astype(np.int64)
        larger = np.round(growth / GROWTH_STEP).astype(np.int64)
        # one label for each combination of grey or white and the two steps
        kinds, label = np.unique(np.stack([body.mesh.tissue, stiffer, larger], axis=1), axis=0, return_inverse=True)
        moduli = self.moduli()
        materials = {
            1 + i: Material(
                self._law(moduli[kind] * float(np.exp(STIFFNESS_STEP * n)), GROWTH_STEP * grown),
                self.poisson,
                "uncoupled",
            )
            for i, (kind, n, grown) in enumerate(kinds.tolist())
        }
        return (1 + label.ravel()).astype(np.int32), materials

    def _law(self, modulus: float, growth: float) -> GrownOgden:
        first, second = self.alpha
        mu = (2.0 * modulus * self.share / first, 2.0 * modulus * (1.0 - self.share) / second)
        return GrownOgden(mu, self.alpha, growth)


def _modulus(kind: str, k: float) -> float:
    """Shear modulus [Pa] at k: log-linear between the ends of the range and its middle."""
    return float(np.exp(np.interp(k, (-2.0, 0.0, 2.0), np.log(RANGES[kind]))))
