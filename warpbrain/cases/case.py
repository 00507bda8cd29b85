"""A case: an anatomy, what is assumed to act on it and what was recorded, before any of it is computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from warpbrain.arrays import Int32s
from warpbrain.cases.boundary import Boundary, Fixed, Sliding
from warpbrain.cases.specimen import Specimen
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import LAWS, Law
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.recordings.base import Registration
from warpbrain.recordings.recording import Recording
from warpbrain.shown import Shown


@dataclass(frozen=True)
class Tissue:
    """A tissue of a case."""

    name: str
    law: Law | None  # None if the generative model is to give it (``mu = "prior"``)
    formulation: str = "coupled"
    prior: str = ""  # group of the generative model; may be empty
    model: str = "neo-hookean"  # name of the law, which is known even where its parameters are not
    #: Relative standard deviation of its modulus, where that was measured; None: as is believed of what is declared.
    accuracy: float | None = None

    @property
    def known_law(self) -> Law:
        """The law, or that of the prior's middle curve; `InputError` if there are no studies of its group."""
        if self.law is not None:
            return self.law
        from warpbrain.gp.sampling import middle_law

        try:
            return middle_law(self.prior, self.model)
        except InputError as error:
            raise InputError(f'{self.name}: mu = "prior": {error}') from None


@dataclass(frozen=True)
class Case(Shown):
    """What a `case.toml` says, in SI units and RAS axes.

    Attributes
    ----------
    name, title, origin : str
        ``origin`` is ``"measured"``, ``"stand-in"`` or ``"synthetic"``.
    path : Path
        The file that was read.
    frame : Frame
        Unit and axes of the folder's files, in which they are written again.
    gravity_axis : (float, float, float) or None
        Where 'down' was while recording; None if unknown.
    registration : Registration or None
        How well recordings are registered to the anatomy; None if the case does not say.
    mesh : TetMesh
        The imaged anatomy, whole.
    mesh_file : str
        Relative to the folder; empty for a specimen.
    specimen : Specimen or None
    tissues : mapping of int to Tissue
    density, poisson : float
        [kg/m3] and without unit.
    heterogeneity : float or None
        Standard deviation of `ln mu` from place to place within a tissue; None if the case does not say.
    boundaries : tuple of Boundary
    mechanisms : tuple of Mechanism
    recordings : tuple of Recording
    remarks : tuple of str
        What a user should know of how the files were read.
    """

    name: str
    title: str
    origin: str
    path: Path
    mesh: TetMesh
    tissues: Mapping[int, Tissue]
    density: float
    poisson: float
    heterogeneity: float | None = None
    frame: Frame = field(default_factory=Frame)
    gravity_axis: tuple[float, float, float] | None = None
    registration: Registration | None = None
    mesh_file: str = "mesh.vtu"
    specimen: Specimen | None = None
    boundaries: tuple[Boundary, ...] = ()
    mechanisms: tuple[Mechanism, ...] = ()
    recordings: tuple[Recording, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def folder(self) -> Path:
        """The case folder."""
        return self.path.parent

    @property
    def assumptions(self) -> tuple[str, ...]:
        """One sentence for each thing that is assumed to act."""
        sentences = tuple(boundary.sentence() for boundary in self.boundaries)
        return sentences + tuple(mechanism.sentence + mechanism.detail() for mechanism in self.mechanisms)

    @property
    def nothing_acts(self) -> bool:
        """Whether the body must stay at rest: it is held, and cut perhaps, but nothing moves or loads it. A specimen is
        moved by its tests."""
        holding = all(isinstance(boundary, Fixed | Sliding) for boundary in self.boundaries)
        return (
            self.specimen is None and holding and all(isinstance(mechanism, Resection) for mechanism in self.mechanisms)
        )

    @property
    def resection(self) -> Resection | None:
        """What was taken out."""
        return next((m for m in self.mechanisms if isinstance(m, Resection)), None)

    @cached_property
    def remaining(self) -> tuple[TetMesh, Int32s]:
        """The mesh without what was resected, and for each of its nodes the id in the whole mesh."""
        if self.resection is None:
            return self.mesh, np.arange(len(self.mesh.points), dtype=np.int32)
        return self.resection.remaining(self.mesh)

    def boundary(self, name: str) -> Boundary:
        """The boundary of a name; `InputError` if there is none."""
        for boundary in self.boundaries:
            if boundary.name == name:
                return boundary
        known = ", ".join(f"'{b.name}'" for b in self.boundaries) or "none"
        raise InputError(f"no [[boundary]] is called '{name}' (there are: {known})")

    def with_law(self, name: str) -> Case:
        """The same case with every tissue under another law of the same shear modulus, in its usual shape."""
        if name not in LAWS:
            raise InputError(f"model '{name}': expected one of {', '.join(LAWS)}")

        def convert(tissue: Tissue) -> Tissue:
            if tissue.model == name:
                return tissue
            law = None if tissue.law is None else LAWS[name].of_shear_modulus(tissue.law.shear_modulus)
            return replace(tissue, law=law, model=name)

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
            tissue = tissues[label]
            if not mu > 0.0 or not np.isfinite(mu):
                raise InputError(f"mu {label}={mu:g}: the shear modulus of {tissue.name} must be positive [Pa]")
            law = LAWS[tissue.model].of_shear_modulus(mu) if tissue.law is None else tissue.law.scaled_to(mu)
            tissues[label] = replace(tissue, law=law)
        return replace(self, tissues=tissues)
