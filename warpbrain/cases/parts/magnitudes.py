"""Whether the responses of tests have the order of magnitude that their unit says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from warpbrain.cases.case import Tissue
from warpbrain.cases.case_template import OTHER_MU
from warpbrain.cases.format.reading import Context
from warpbrain.cases.specimen import REST, Specimen
from warpbrain.recordings.recording import Recording, TestRecording

#: A response that is so many times off is not that of another tissue: a unit that is off by 1000 is so of any tissue
#: that is up to ten times softer or stiffer than was declared.
_OFF = 100.0
#: Strain up to which responses are compared: beyond it tissue stiffens more than a unit can be off (an Ogden law with
#: an exponent of -20, as of brain, answers 30 % of compression with 200 times what its small-strain modulus does).
_SMALL = 0.1


def check_magnitudes(
    context: Context, specimen: Specimen, tissues: Mapping[int, Tissue], nu: float, recordings: Sequence[Recording]
) -> None:
    """Note tests whose response is far from what the declared tissue would answer at small strain."""
    laws = [tissue.law for tissue in tissues.values() if tissue.law is not None]
    mu = laws[0].shear_modulus if laws else OTHER_MU
    tables = context.tables.get("recording", [])
    for recording in recordings:
        if not isinstance(recording, TestRecording):
            continue
        strain = specimen.strain_of(recording.mode, recording.quantities[0], recording.imposed) - REST[recording.mode]
        factor = mu * _response_to_one_pascal(specimen, nu, recording)
        strained = np.abs(strain)[strain != 0.0]
        if not strained.size:
            continue
        rows = np.abs(strain) <= max(_SMALL, float(strained.min()))
        expected, response = factor * strain[rows], recording.response[rows]
        if not response.any():
            continue
        times = float(np.sqrt(response @ response / (expected @ expected)))
        if 1.0 / _OFF < times < _OFF:
            continue
        number, unit = next(
            (k, table.get("unit", "Pa"))
            for k, table in enumerate(tables, 1)
            # what is no table is a problem that was noted when it was read
            if isinstance(table, dict) and table.get("name") == recording.name
        )
        message = (
            f"the {recording.quantities[1]} is {times:.2g} times what the declared tissue (mu = {mu:g} Pa) answers"
        )
        if recording.quantities[1] != "stress":
            context.problems.add(
                context.file, f"[recording {number}] file", message, "forces are in N, torques in N m, lengths in units"
            )
            continue
        other = "kPa" if times < 1.0 else "Pa"
        cure = f'perhaps unit = "{other}"' if other != unit else "is mu in Pa?"
        context.problems.add(context.file, f"[recording {number}] unit", f"{message} if it is in {unit}", cure)


def _response_to_one_pascal(specimen: Specimen, nu: float, recording: TestRecording) -> float:
    """The response to a strain of 1 of a linear elastic specimen with a shear modulus of 1 Pa."""
    moduli = {
        "axial": 2.0 * (1.0 + nu),
        "shear": 1.0,
        # the shear grows from the axis to the rim
        "torsion": 0.75,
        "confined": 2.0 * (1.0 - nu) / (1.0 - 2.0 * nu),
        "biaxial": 2.0 * (1.0 + nu) / (1.0 - nu),
    }
    return moduli[recording.mode] / specimen.stress_unit(recording.quantities[1])
