"""A case: an anatomy and what is assumed to act on it, before any of it is computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import LAWS, Law
from warpbrain.physics.load import Load
from warpbrain.physics.resection import Resection


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
    unread_recordings : int
        Recordings that the file names and this version does not compare with.
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
    unread_recordings: int = 0

    def with_law(self, name: str) -> Case:
        """The same case with every tissue under another law of the same shear modulus, in its usual shape."""
        if name not in LAWS:
            raise InputError(f"model '{name}': expected one of {', '.join(LAWS)}")

        def convert(tissue: Tissue) -> Tissue:
            if tissue.law.name == name:
                return tissue
            return replace(tissue, law=LAWS[name].of_shear_modulus(tissue.law.shear_modulus))

        return replace(self, tissues={label: convert(tissue) for label, tissue in self.tissues.items()})

    def with_shear_moduli(self, moduli: Mapping[int, float]) -> Case:
        """The same case with the shear moduli [Pa] of some tissues, by label."""
        unknown = sorted(set(moduli) - set(self.tissues))
        if unknown:
            known = ", ".join(f"{label} ({tissue.name})" for label, tissue in sorted(self.tissues.items()))
            label = unknown[0]
            raise InputError(f"mu {label}={moduli[label]:g}: no tissue {label} in this case (it has {known})")
        tissues = dict(self.tissues)
        for label, mu in moduli.items():
            if not mu > 0.0 or not np.isfinite(mu):
                name = tissues[label].name
                raise InputError(f"mu {label}={mu:g}: the shear modulus of {name} must be positive [Pa]")
            tissues[label] = replace(tissues[label], law=tissues[label].law.scaled_to(mu))
        return replace(self, tissues=tissues)
