"""The curves of a diagnosis of a specimen as a table: recorded and simulated stress, what figures are made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpbrain.atomic import whole_file
from warpbrain.worlds.specimen.result import SpecimenDiagnosis


def write_curves(path: Path, found: SpecimenDiagnosis) -> None:
    """Write one row for each that was compared; times [s] are empty where there are none, stresses are nominal [Pa]."""
    names = list(found.stresses)
    header = [
        "test",
        "mode",
        "role",
        "time_s",
        "strain",
        "recorded_pa",
        *(f"{name.replace(' ', '_')}_pa" for name in names),
    ]
    lines = [",".join(header)]
    for test, rows in zip(found.protocol.tests, found.protocol.rows, strict=True):
        label = '"' + test.name.replace('"', '""') + '"'
        simulated = np.column_stack([found.stresses[name][rows] for name in names])
        for k in range(len(test.strain)):
            time = "" if test.time is None else f"{test.time[k]:.9g}"
            numbers = [f"{test.strain[k]:.9g}", f"{test.stress[k]:.9g}"]
            numbers += ["" if np.isnan(value) else f"{value:.9g}" for value in simulated[k]]
            lines.append(",".join([label, test.mode, "fit" if test.fitted else "check", time, *numbers]))
    with whole_file(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
