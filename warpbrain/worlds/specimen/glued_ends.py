"""How much more a glued specimen resists than a homogeneous state: computed with finite elements, as a factor.

The factor is the nominal stress of the rig (`warpbrain.simulation.specimen`) over that of the homogeneous state, both
of one law, at a few strains. It is computed for the law that a hypothesis has arrived at, and again when that has
changed. Memory is taken to have the same factor. Where the rig finds no equilibrium, far out, the factor of the
farthest strain that it reached is kept.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.cases.specimen import Specimen
from warpbrain.errors import SolveError
from warpbrain.recordings.recording import TestRecording
from warpbrain.simulation.specimen import HOMOGENEOUS, Rig
from warpbrain.worlds.specimen.material import HomogeneousMaterial, NoStateError
from warpbrain.worlds.specimen.protocol import REST, Protocol, radius_of, strain_of, stress_unit

#: Steps of the rig to the farther extreme; the largest strain it is asked for, of a stretch and of a shear.
_STEPS, _STRETCH, _SHEAR = 4, 0.6, 0.8
#: Relative difference of parameters up to which laws have one factor: an exponent of -16 or -17.5, a per cent of it.
_NEAR = 0.1
#: Plain tetrahedra are too stiff between glued ends, by a tenth in nearly incompressible tissue.
ELEMENTS = "tet4-averaged"
_QUANTITIES = {"axial": ("stretch", "stress"), "shear": ("displacement", "force"), "torsion": ("angle", "torque")}


@dataclass(frozen=True, eq=False)
class Curve:
    """Factors at strains, of a mode."""

    strain: Floats
    factor: Floats

    def at(self, strain: Floats) -> Floats:
        """At any strain: straight from point to point, constant beyond the last."""
        return np.interp(strain, self.strain, self.factor)


@dataclass(eq=False)
class GluedEnds:
    """Factors of a specimen with its ends glued, for any law.

    Parameters
    ----------
    case : Case
    protocol : Protocol
    device : str, optional
    """

    case: Case
    protocol: Protocol
    device: str | None = None
    _known: list[tuple[HomogeneousMaterial, dict[str, Curve]]] = field(default_factory=list)

    def curves(self, material: HomogeneousMaterial) -> dict[str, Curve]:
        """By mode, of a law; computed once for laws that are nearly alike, whatever their modulus."""
        for known, curves in self._known:
            if _alike(known, material):
                return curves
        modes = dict.fromkeys(test.mode for test in self.protocol.tests)
        found = {mode: self._curve(mode, material) for mode in modes}
        self._known.append((material, found))
        return found

    def factor(self, material: HomogeneousMaterial, protocol: Protocol) -> Floats:
        """At all rows (n,) of a protocol of the same tests."""
        curves = self.curves(material)
        return np.concatenate([curves[test.mode].at(test.strain) for test in protocol.tests])

    def _curve(self, mode: str, material: HomogeneousMaterial) -> Curve:
        rest = REST[mode]
        if mode in HOMOGENEOUS:
            return Curve(np.array([rest]), np.ones(1))
        most = _STRETCH if mode == "axial" else _SHEAR
        strains = np.concatenate([test.strain for test in self.protocol.tests if test.mode == mode]) - rest
        low, high = max(float(strains.min()), -most), min(float(strains.max()), most)
        reach = max(-low, high)
        elastic = replace(material, moduli=(), times=(), storing=())
        for shrink in (1.0, 0.5, 0.25):
            recording = self._recording(mode, np.array([rest + shrink * low, rest + shrink * high]))
            try:
                found = self._rig(material).run(recording, _STEPS)
            except SolveError:
                continue
            strain = strain_of(self.case_specimen, mode, recording.quantities[0], found.imposed)
            moved = np.abs(strain - rest) > 0.05 * reach
            try:
                homogeneous = elastic.stress(mode, strain[moved], None)
            except NoStateError:
                continue
            unit = stress_unit(self.case_specimen, recording)
            return Curve(strain[moved], unit * found.response[moved] / homogeneous)
        return Curve(np.array([rest]), np.ones(1))

    @property
    def case_specimen(self) -> Specimen:
        """The specimen with its ends glued."""
        assert self.case.specimen is not None
        return replace(self.case.specimen, grips="glued")

    def _recording(self, mode: str, strain: Floats) -> TestRecording:
        height = self.case_specimen.size[2]
        to_imposed = {"axial": 1.0, "shear": height, "torsion": height / radius_of(self.case_specimen)}[mode]
        return TestRecording(
            name=mode,
            file="",
            mode=mode,
            quantities=_QUANTITIES[mode],
            imposed=to_imposed * strain,
            response=np.zeros(len(strain)),
        )

    def _rig(self, material: HomogeneousMaterial) -> Rig:
        [(label, tissue)] = self.case.tissues.items()
        law = material.law
        tissue = replace(tissue, law=law, model=law.name, formulation=material.formulation)
        case = replace(
            self.case, specimen=self.case_specimen, tissues={label: tissue}, poisson=material.poisson, mechanisms=()
        )
        return Rig(case, self.device, elements=ELEMENTS)


def _alike(one: HomogeneousMaterial, other: HomogeneousMaterial) -> bool:
    """Whether two laws differ so little, apart from their modulus, that the shape has one factor for both."""
    if type(one.law) is not type(other.law) or (one.poisson, one.formulation) != (other.poisson, other.formulation):
        return False
    mine, its = (np.array(each.law.scaled_to(1.0).parameters()) for each in (one, other))
    return mine.shape == its.shape and bool(np.allclose(mine, its, rtol=_NEAR, atol=0.0))
