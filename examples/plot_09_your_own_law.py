"""
Your own law
============

Fung's exponential law as Demiray (1972, J. Biomech. 5) wrote it, in one file: its energy for the host, its energy and
derivatives for the device, and the class. Energy by invariants, in the coupled formulation:

    Psi = mu / (2 b) (exp(b (I1 - 3)) - 1) - mu ln J + lam / 2 (ln J)^2
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import matplotlib.pyplot as plt
import numpy as np
import warp as wp

import warpbrain as wb
from warpbrain.physics.laws.device import InvariantLaw
from warpbrain.physics.laws.law import Law, LawKey


@wp.func
def energy(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    lam, mu, b = parameters[e, 0], parameters[e, 1], parameters[e, 2]
    log_J = wp.log(J)
    half, one = type(J)(0.5), type(J)(1.0)
    return half * mu / b * (wp.exp(b * (I1 - type(J)(3.0))) - one) - mu * log_J + half * lam * log_J * log_J


@wp.func
def derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    """By I1, I2, J; then I1 I1, I1 I2, I1 J, I2 I2, I2 J, J J."""
    lam, mu, b = parameters[e, 0], parameters[e, 1], parameters[e, 2]
    zero = type(J)(0.0)
    d1 = type(J)(0.5) * mu * wp.exp(b * (I1 - type(J)(3.0)))
    pressure = lam * wp.log(J) - mu
    return d1, zero, pressure / J, b * d1, zero, zero, zero, zero, (lam - pressure) / (J * J)


@dataclass(frozen=True)
class Demiray(Law):
    """Shear modulus at rest `mu` [Pa], and `b` without unit: how fast it stiffens."""

    mu: float
    b: float
    name: ClassVar[str] = "demiray"
    keys: ClassVar[dict[str, LawKey]] = {"mu": LawKey("Shear modulus."), "b": LawKey("How it stiffens.", unit="")}

    @property
    def shear_modulus(self) -> float:
        return self.mu

    @classmethod
    def of_shear_modulus(cls, mu: float) -> "Demiray":
        return cls(mu, 3.0)

    def parameters(self) -> tuple[float, ...]:
        return (self.mu, self.b)

    def energy(self, stretches: np.ndarray) -> np.ndarray:
        return self.mu / (2.0 * self.b) * np.expm1(self.b * (np.sum(stretches**2, axis=-1) - 3.0))

    @classmethod
    def device_law(cls, formulation: str) -> InvariantLaw:
        if formulation != "coupled":
            raise wb.InputError("demiray: formulation: expected 'coupled'")
        return InvariantLaw("demiray_coupled", energy, derivatives, second_invariant=False)

    def scaled_to(self, shear_modulus: float) -> "Demiray":
        return Demiray(shear_modulus, self.b)


# %%
# It is stable in the range that the paper asks for, and simulated as any other: the phantom under 1 N.

own = Demiray(900.0, 2.0)
wb.require_stable(own, 0.45)
model = wb.model_of(wb.find_case("phantom-loaded", "single"))
results = {}
for law in (wb.NeoHookean(900.0), own):
    system = wb.System(replace(model, materials={1: wb.Material(law, 0.45)}), "cpu")
    wb.solve_equilibrium(system)
    results[law.name] = wb.result_of(system)

# %%
# What differs: it stiffens where it is strained.

figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
stretch = np.linspace(0.7, 1.4, 100)
for law in (wb.NeoHookean(900.0), own):
    three = np.stack([stretch, stretch**-0.5, stretch**-0.5], -1)
    axes.plot(stretch, np.gradient(law.energy(three), stretch), label=law.name)
axes.set_xlabel("stretch")
axes.set_ylabel("nominal stress [Pa], incompressible")
axes.legend()
plt.show()
sizes = {name: 1000.0 * np.linalg.norm(result.u, axis=1).max() for name, result in results.items()}
print(", ".join(f"{name}: moves by at most {size:.2f} mm" for name, size in sizes.items()))

# %%

results["demiray"].plot(cut="y", exaggeration=5.0)
