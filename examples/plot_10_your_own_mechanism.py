"""
Your own mechanism
==================

A head that is turned fast: tissue is pushed outwards by ``rho omega^2 r``. One class says what it is, its parameters
with their units, and its forces; in ``warpbrain/physics/mechanisms`` the registry would find it, and `case.toml`,
``--with`` and the diagnosis would know it. Here it is used from where it stands.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

import warpbrain as wb
from warpbrain.mesh import volume_forces
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism, parameter
from warpbrain.physics.potential import Enters


@dataclass(frozen=True, kw_only=True)
class Turning(Load, Mechanism):
    """Centrifugal force about the axis z through the origin."""

    speed: float = parameter("Angular speed.", unit="rad/s", above=0.0)
    density: float = parameter("Of the tissue.", unit="kg/m3", default=1040.0, above=0.0)
    kind: ClassVar[str] = "turning"
    quadratic: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("load", "f_turning")
    together: ClassVar[Mapping[str, str]] = {}
    sentence: ClassVar[str] = "The head turns about its axis."
    example: ClassVar[str] = "turning:speed=10"
    confused_with: ClassVar[tuple[str, ...]] = ("swelling",)

    def nodal_forces(self, mesh):
        """Forces on the nodes [N]: a force per volume, integrated with the shape functions."""
        outwards = np.array([1.0, 1.0, 0.0])
        return volume_forces(mesh, lambda points: self.density * self.speed**2 * points * outwards)


# %%
# The phantom at two turns a second, without anything else.

case = replace(wb.find_case("phantom", "single").with_shear_moduli({1: 900.0}), mechanisms=())
case = replace(case, boundaries=tuple(b for b in case.boundaries if b.name != "superior cap"))
case = replace(case, mechanisms=(Turning(speed=4.0 * np.pi),))
done = wb.run(case, device="cpu")
done

# %%

done.plot(cut="z")

# %%
# The forces sum to mass times omega squared times the distance of the centre of mass: a check that needs no solver.

model = wb.model_of(case)
mass = 1040.0 * model.mesh.volumes
centre = (mass[:, None] * model.mesh.points[model.mesh.tetrahedra].mean(axis=1)).sum(axis=0)
expected = (4.0 * np.pi) ** 2 * centre * [1.0, 1.0, 0.0]
np.testing.assert_allclose(model.external_forces().sum(axis=0), expected, rtol=1e-9, atol=1e-12)
