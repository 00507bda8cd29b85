"""B1: FEBio's test problem te01, with its own law - which shows that a new law is one file of device functions."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp
from bodies import model_of
from numpy.typing import NDArray
from shapes import tetrahedron

from warpbrain.mesh import TetMesh
from warpbrain.physics.force import NodalForce
from warpbrain.physics.laws import Law
from warpbrain.physics.laws.device import InvariantLaw
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

NUMBERS = json.loads((Path(__file__).parent / "data" / "structures.json").read_text())["B1 FEBio te01 single tet"]


@wp.func
def _energy(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    K = parameters[e, 0]
    c1 = parameters[e, 1]
    root = wp.cbrt(J)
    log_J = wp.log(J)
    return c1 * (I1 / (root * root) - type(J)(3.0)) + type(J)(0.5) * K * log_J * log_J


@wp.func
def _derivatives(I1: Any, I2: Any, J: Any, parameters: wp.array2d[Any], e: int):
    K = parameters[e, 0]
    zero = type(J)(0.0)
    root = wp.cbrt(J)
    log_J = wp.log(J)
    d1 = parameters[e, 1] / (root * root)
    d1J = type(J)(-2.0) / type(J)(3.0) * d1 / J
    dJJ = type(J)(-5.0) / type(J)(3.0) * d1J * I1 / J + K * (type(J)(1.0) - log_J) / (J * J)
    return d1, zero, d1J * I1 + K * log_J / J, zero, zero, d1J, zero, zero, dJJ


_DEVICE = InvariantLaw("test_te01", _energy, _derivatives, second_invariant=False)


@dataclass(frozen=True)
class LogarithmicNeoHookean(Law):
    """`c1 (J^(-2/3) I1 - 3) + K/2 (ln J)^2`: FEBio's uncoupled Mooney-Rivlin without `c2`."""

    c1: float
    K: float
    name: ClassVar[str] = "logarithmic neo-hookean"
    keys: ClassVar[Mapping[str, type]] = {"c1": float, "K": float}

    @property
    def shear_modulus(self) -> float:
        return 2.0 * self.c1

    @classmethod
    def of_shear_modulus(cls, mu: float) -> "LogarithmicNeoHookean":
        return cls(0.5 * mu, 10.0 * mu)

    def parameters(self) -> tuple[float, ...]:
        return (self.c1,)

    def energy(self, stretches: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.c1 * (np.sum(stretches**2, axis=-1) - 3.0)

    @classmethod
    def device_law(cls, formulation: str) -> InvariantLaw:
        return _DEVICE

    def scaled_to(self, shear_modulus: float) -> "LogarithmicNeoHookean":
        factor = shear_modulus / self.shear_modulus
        return LogarithmicNeoHookean(factor * self.c1, factor * self.K)

    def volumetric_modulus(self, poisson: float, formulation: str) -> float:
        return self.K


def test_te01(device: str) -> None:
    """One tetrahedron; each node slides on its own axis; 0.5 N push the last one down."""
    corner = tetrahedron()
    mesh = TetMesh(corner.points, corner.tetrahedra, node_sets={"tip": np.arange(4) == 3})
    constrained = corner.points == 0.0
    push = NodalForce(nodes="tip", total=(0.0, 0.0, -0.5))
    material = Material(LogarithmicNeoHookean(1.0, 1000.0), formulation="uncoupled")
    model = model_of(mesh, material, constrained=constrained, loads=[push])
    found = solve_equilibrium(System(model, device), EquilibriumOptions(tolerance=1e-12))
    x = found.u + mesh.points
    assert x[1, 0] == pytest.approx(x[2, 1], rel=1e-10)
    # our second opinion: SciPy on three stretches, with differences of the energy
    assert x[1, 0] == pytest.approx(NUMBERS["lateral"], rel=1e-7)
    assert x[3, 2] == pytest.approx(NUMBERS["axial"], rel=1e-7)
    # FEBio's golden value; its convergence tolerance shows in the eighth digit
    assert np.linalg.norm(found.u) == pytest.approx(NUMBERS["febio_gold"], rel=2e-8)
