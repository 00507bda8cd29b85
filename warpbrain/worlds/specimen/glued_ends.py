"""How much more a glued specimen resists than a homogeneous state: computed with finite elements, as a factor.

The factor is the nominal stress of the rig (`warpbrain.simulation.specimen`) over that of the homogeneous state, both
of one law, at a few strains. It is computed for the law that a hypothesis has arrived at, and again when that has
changed. Memory is taken to have the same factor. Where the rig finds no equilibrium, far out, the factor of the
farthest strain that it reached is kept.
"""

from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.cases.specimen import REST
from warpbrain.errors import SolveError
from warpbrain.recordings.recording import TestRecording
from warpbrain.simulation.specimen import HOMOGENEOUS, Rig, specimen_of
from warpbrain.worlds.specimen.material import HomogeneousMaterial, NoStateError
from warpbrain.worlds.specimen.protocol import Protocol

#: Steps of the rig to the farther extreme; the largest strain it is asked for, of a stretch and of a shear.
_STEPS, _STRETCH, _SHEAR = 4, 0.6, 0.8
#: Relative difference of parameters up to which laws have one factor: an exponent of -16 or -17.5, a per cent of it.
_NEAR = 0.1
#: Plain tetrahedra are too stiff between glued ends, by a tenth in nearly incompressible tissue.
ELEMENTS = "tet4-averaged"
_QUANTITIES = {"axial": ("stretch", "stress"), "shear": ("displacement", "force"), "torsion": ("angle", "torque")}


class GluedEnds:
    """Factors of a specimen with its ends glued, for any law, over the strains of all recorded rows."""

    def __init__(self, case: Case, protocol: Protocol, device: str | None = None) -> None:
        self._specimen = replace(specimen_of(case), grips="glued")
        self._case, self._protocol, self._device = case, protocol, device
        #: Of laws that were asked for: by mode strains, and factors at these.
        self._known: list[tuple[HomogeneousMaterial, dict[str, tuple[Floats, Floats]]]] = []

    def factor(self, material: HomogeneousMaterial, protocol: Protocol) -> Floats:
        """At all rows (n,) of a protocol of the same tests: straight from strain to strain, constant beyond the last.

        Computed once for laws that are nearly alike, whatever their modulus.
        """
        curves = next((curves for known, curves in self._known if _alike(known, material)), None)
        if curves is None:
            modes = dict.fromkeys(test.mode for test in self._protocol.tests)
            curves = {mode: self._curve(mode, material) for mode in modes}
            self._known.append((material, curves))
        return np.concatenate([np.interp(test.strain, *curves[test.mode]) for test in protocol.tests])

    def _curve(self, mode: str, material: HomogeneousMaterial) -> tuple[Floats, Floats]:
        """Strains and factors of a mode."""
        rest = REST[mode]
        none = np.array([rest]), np.ones(1)
        if mode in HOMOGENEOUS:
            return none
        most = _STRETCH if mode == "axial" else _SHEAR
        strains = np.concatenate([test.strain for test in self._protocol.tests if test.mode == mode]) - rest
        low, high = max(float(strains.min()), -most), min(float(strains.max()), most)
        elastic = replace(material, moduli=(), times=(), storing=())
        for shrink in (1.0, 0.5, 0.25):
            recording = self._recording(mode, np.array([rest + shrink * low, rest + shrink * high]))
            try:
                simulated = self._rig(material).run(recording, _STEPS)
                strain = self._specimen.strain_of(mode, recording.quantities[0], simulated.imposed)
                moved = np.abs(strain - rest) > 0.05 * max(-low, high)
                homogeneous = elastic.stress(mode, strain[moved], None)
            except (SolveError, NoStateError):
                continue
            unit = self._specimen.stress_unit(recording.quantities[1])
            return strain[moved], unit * simulated.response[moved] / homogeneous
        return none

    def _recording(self, mode: str, strain: Floats) -> TestRecording:
        height = self._specimen.size[2]
        to_imposed = {"axial": 1.0, "shear": height, "torsion": height / self._specimen.radius}[mode]
        return TestRecording(
            name=mode, file="", mode=mode, quantities=_QUANTITIES[mode], imposed=to_imposed * strain,
            response=np.zeros(len(strain)),
        )  # fmt: skip

    def _rig(self, material: HomogeneousMaterial) -> Rig:
        [(label, tissue)] = self._case.tissues.items()
        law = material.law
        tissue = replace(tissue, law=law, model=law.name, formulation=material.formulation)
        case = replace(
            self._case, specimen=self._specimen, tissues={label: tissue}, poisson=material.poisson, mechanisms=()
        )
        return Rig(case, self._device, elements=ELEMENTS)


def _alike(material: HomogeneousMaterial, other: HomogeneousMaterial) -> bool:
    """Whether two laws differ so little, apart from their modulus, that the shape has one factor for both."""
    if type(material.law) is not type(other.law) or (material.poisson, material.formulation) != (
        other.poisson,
        other.formulation,
    ):
        return False
    mine, its = (np.array(each.law.scaled_to(1.0).parameters()) for each in (material, other))
    return mine.shape == its.shape and bool(np.allclose(mine, its, rtol=_NEAR, atol=0.0))
