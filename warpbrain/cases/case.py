"""A case: an anatomy and what is assumed to act on it, before any of it is computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import LAWS, Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.physics.load import Load
from warpbrain.physics.resection import Resection
from warpbrain.simulation.model import Material, Model

#: Where the one number `--mu` meets a law with more parameters: the ratio C2/C1 and the exponent that keep its shape.
#: Equal coefficients; and the exponent of a one-term Ogden law for brain of Miller and Chinzei (2002), -4.7.
DEFAULT_MOONEY_RATIO = 1.0
DEFAULT_OGDEN_EXPONENT = -4.7


@dataclass(frozen=True)
class Tissue:
    """A tissue of a case.

    Attributes
    ----------
    name : str
    law : Law
    formulation : str
    """

    name: str
    law: Law
    formulation: str = "coupled"


@dataclass(frozen=True)
class Case:
    """What a `case.toml` says, in SI units and RAS axes.

    Attributes
    ----------
    name, title, origin : str
        ``origin`` is ``"measured"``, ``"stand-in"`` or ``"synthetic"``.
    path : Path
        The file that was read.
    mesh : TetMesh
        The imaged anatomy, whole.
    tissues : mapping of int to Tissue
    density, poisson : float
        [kg/m3] and without unit.
    fixed : tuple of (str, (n,) bool array)
        Names and members of the node sets that do not move.
    displaced : tuple of (str, (n,) bool array, (3,) array)
        Node sets with a prescribed displacement [m].
    loads : tuple of Load
    resection : Resection or None
    assumptions : tuple of str
        One sentence for each thing that is assumed to act.
    """

    name: str
    title: str
    origin: str
    path: Path
    mesh: TetMesh
    tissues: Mapping[int, Tissue]
    density: float
    poisson: float
    fixed: tuple[tuple[str, NDArray[np.bool_]], ...]
    displaced: tuple[tuple[str, NDArray[np.bool_], NDArray[np.float64]], ...] = ()
    loads: tuple[Load, ...] = ()
    resection: Resection | None = None
    assumptions: tuple[str, ...] = ()

    def with_law(self, name: str) -> Case:
        """The same case with every tissue under another law of the same shear modulus.

        Mooney-Rivlin takes equal coefficients, Ogden one term with the exponent -4.7.
        """
        if name not in LAWS:
            raise InputError(f"--model {name}: expected one of {', '.join(LAWS)}")

        def convert(tissue: Tissue) -> Tissue:
            if tissue.law.name == name:
                return tissue
            return replace(tissue, law=law_of_shear_modulus(name, tissue.law.shear_modulus))

        return replace(self, tissues={label: convert(tissue) for label, tissue in self.tissues.items()})

    def with_shear_moduli(self, moduli: Mapping[int, float]) -> Case:
        """The same case with the shear moduli [Pa] of some tissues, by label."""
        unknown = sorted(set(moduli) - set(self.tissues))
        if unknown:
            known = ", ".join(f"{label} ({tissue.name})" for label, tissue in sorted(self.tissues.items()))
            label = unknown[0]
            raise InputError(f"--mu {label}={moduli[label]:g}: no tissue {label} in this case (it has {known})")
        tissues = dict(self.tissues)
        for label, mu in moduli.items():
            if not mu > 0.0 or not np.isfinite(mu):
                name = tissues[label].name
                raise InputError(f"--mu {label}={mu:g}: the shear modulus of {name} must be positive [Pa]")
            tissues[label] = replace(tissues[label], law=tissues[label].law.scaled_to(mu))
        return replace(self, tissues=tissues)

    def build(self) -> tuple[Model, NDArray[np.int32]]:
        """The model to compute, and for each of its nodes the id in the whole mesh (tissue may have been resected)."""
        mesh, nodes = self.mesh, np.arange(len(self.mesh.points), dtype=np.int32)
        if self.resection is not None:
            mesh, nodes = self.resection.remaining(mesh)
        constrained = np.zeros(mesh.points.shape, dtype=bool)
        prescribed = np.zeros(mesh.points.shape)
        for _, members, displacement in self.displaced:
            constrained[members[nodes]] = True
            prescribed[members[nodes]] = displacement
        for _, members in self.fixed:
            constrained[members[nodes]] = True
            prescribed[members[nodes]] = 0.0
        materials = {
            label: Material(tissue.law, self.poisson, tissue.formulation) for label, tissue in self.tissues.items()
        }
        model = Model(mesh, materials, self.density, constrained, prescribed, self.loads)
        return model, nodes


def law_of_shear_modulus(name: str, mu: float) -> Law:
    """A law by name with a shear modulus at rest [Pa] and the default shape."""
    if name == NeoHookean.name:
        return NeoHookean(mu)
    if name == MooneyRivlin.name:
        C1 = 0.5 * mu / (1.0 + DEFAULT_MOONEY_RATIO)
        return MooneyRivlin(C1, DEFAULT_MOONEY_RATIO * C1)
    return Ogden((2.0 * mu / DEFAULT_OGDEN_EXPONENT,), (DEFAULT_OGDEN_EXPONENT,))
