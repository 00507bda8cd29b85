"""Whether the responses of tests have the order of magnitude that their unit says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Tissue
from warpbrain.cases.case_template import OTHER_MU
from warpbrain.cases.parts.context import Context
from warpbrain.cases.specimen import Specimen
from warpbrain.recordings.recording import Recording, TestRecording

#: A response that is so many times off is not that of another tissue: a unit that is off by 1000 is so of any tissue
#: that is up to ten times softer or stiffer than was declared.
_OFF = 100.0


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
        expected = mu * _response_to_one_pascal(specimen, nu, recording)
        squares = float(expected @ expected)
        if not squares > 0.0 or not recording.response.any():
            continue
        times = float(np.sqrt(recording.response @ recording.response / squares))
        if 1.0 / _OFF < times < _OFF:
            continue
        number, unit = next(
            (k, table.get("unit", "Pa")) for k, table in enumerate(tables, 1) if table.get("name") == recording.name
        )
        said = f"the {recording.quantities[1]} is {times:.2g} times what the declared tissue (mu = {mu:g} Pa) answers"
        if recording.quantities[1] != "stress":
            context.problems.add(
                context.file, f"[recording {number}] file", said, "forces are in N, torques in N m, lengths in units"
            )
            continue
        other = "kPa" if times < 1.0 else "Pa"
        cure = f'perhaps unit = "{other}"' if other != unit else "is mu in Pa?"
        context.problems.add(context.file, f"[recording {number}] unit", f"{said} if it is in {unit}", cure)


def _response_to_one_pascal(specimen: Specimen, nu: float, recording: TestRecording) -> Floats:
    """The response (n,) to what was imposed of a linear elastic specimen with a shear modulus of 1 Pa."""
    x, y, height = specimen.size
    imposed, response = recording.quantities
    circle = specimen.shape == "cylinder"
    area = np.pi * (0.5 * x) ** 2 if circle else x * y
    if recording.mode == "torsion":
        radius = 0.5 * x if circle else np.sqrt(area / np.pi)
        # T = mu (angle / height) pi R^4 / 2
        return np.asarray(recording.imposed / height * 0.5 * np.pi * radius**4)
    strain = recording.imposed - 1.0 if imposed == "stretch" else recording.imposed / height
    moduli = {
        "axial": 2.0 * (1.0 + nu),
        "shear": 1.0,
        "confined": 2.0 * (1.0 - nu) / (1.0 - 2.0 * nu),
        "biaxial": 2.0 * (1.0 + nu) / (1.0 - nu),
    }
    return np.asarray(moduli[recording.mode] * strain * (area if response == "force" else 1.0))
