"""Two adhesives, declared neo-Hookean: rates, loading and unloading, relaxation.

    python bench/real/adhesive.py DATA --out proof

DATA holds the sheets `<test>__<file>.xlsx` (docs/proof-recordings.md); openpyxl reads them. The sheets do not say the
unit of stress: it is taken for kPa, which changes the modulus and nothing else. Writes `results/real_adhesive.json` and
`docs/figures/real-adhesive.png`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from common import Floats, arguments, declared, diagnose, draw, keep_figure, recorded_test, row, write_results

from warpbrain.cases.case import Case
from warpbrain.cases.specimen import Specimen

#: Stretch to which the tape was pulled, rates of loading and unloading [1/s]; every sheet is of a new specimen.
TAPE = {
    "1d5": ("0d01", "0d03", "0d05"), "2d0": ("0d01", "0d03", "0d05"), "2d5": ("0d01", "0d03", "0d05"),
    "3d0": ("0d01", "0d05"),
}  # fmt: skip
#: Of the tape what is fitted; all others are checks: a rate and larger stretches that were not seen.
FITTED = (("1d5", "0d01"), ("1d5", "0d05"), ("2d0", "0d01"), ("2d0", "0d05"))
#: The layer's sheets: steps of shear, each followed by a rest, at two rates; up and down, with rests, is a check.
LAYER = {"shear_relaxation_1": ("steps, slow", "fit"), "shear_relaxation_5": ("steps, fast", "fit"),
         "shear_relaxation_2": ("steps, between", "check"), "shear_relaxation": ("up and down", "check")}  # fmt: skip
#: Sides and thickness of the layer [m], from its columns of displacement, force, stress and shear.
SIDE, THICKNESS = 1.0e-2, 1.3e-4


def sheet(path: Path) -> Floats:
    """Rows of numbers."""
    import openpyxl

    rows = openpyxl.load_workbook(path, data_only=True).active.iter_rows(values_only=True)
    return np.array([row for row in rows if isinstance(row[0], int | float)], dtype=float)


def tape(data: Path) -> Case:
    """VHB 4910 pulled and let go."""
    tests = []
    for stretch, rates in TAPE.items():
        for rate in rates:
            table = sheet(data / f"uniaxial-loading-unloading-test__loading_{stretch}_unloading_{rate}.xlsx")
            name = f"to {stretch.replace('d', '.')} at {rate.replace('d', '.')} per s"
            role = "fit" if (stretch, rate) in FITTED else "check"
            axes = ("stretch", "stress")
            tests.append(recorded_test(name, "axial", axes, table[:, 1], 1e3 * table[:, 2], table[:, 0], role, name))
    specimen = Specimen("block", (1e-2, 1e-2, 1e-2), "lubricated")
    return declared("tape", "VHB 4910, pulled and let go", specimen, 1e4, 0.49, tests)


def layer(data: Path) -> Case:
    """An optically clear adhesive, sheared in steps."""
    tests = []
    for file, (name, role) in LAYER.items():
        table = sheet(data / f"cyclic-shear-relaxation-test__{file}.xlsx")
        shear, stress = table[:, 4], 1e3 * table[:, 3]
        axes = ("displacement", "force")
        tests.append(recorded_test(name, "shear", axes, THICKNESS * shear, SIDE**2 * stress, table[:, 0], role, name))
    specimen = Specimen("block", (SIDE, SIDE, THICKNESS), "glued")
    return declared("layer", "Optically clear adhesive, sheared in steps", specimen, 1e4, 0.49, tests)


def main() -> None:
    """Diagnose, write, draw."""
    import matplotlib.pyplot as plt

    options = arguments(__doc__.splitlines()[0])
    rows = {}
    figure, axes = plt.subplots(2, 3, figsize=(10.5, 6.4), layout="constrained")
    shown = {"tape": (3, 4, 7), "layer": (1, 2, 3)}
    for line, make in zip(axes, (tape, layer), strict=True):
        case = make(options.data)
        found, said = diagnose(case, options.out)
        rows[case.name] = row(found, said)
        for number, axis in zip(shown[case.name], line, strict=True):
            draw(axis, found, number, "time", ("refitted", "explained"))
    axes[0, 0].legend(frameon=False, fontsize=8)
    write_results("real_adhesive", rows)
    keep_figure(figure, "real-adhesive.png", __file__)


if __name__ == "__main__":
    main()
