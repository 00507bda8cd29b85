"""One human frontal-cortex specimen, declared hyperelastic: what its cycles say, and how cycle 3 and the hold judge it.

    python bench/real/cortex_specimen.py DATA --out proof

DATA holds the files of the specimen as published (docs/proof-recordings.md). Writes `results/real_cortex_specimen.json`
and `docs/figures/real-cortex-specimen.png`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from common import arguments, declared, diagnose, draw, keep_figure, recorded_test, row, write_results

from warpbrain.cases.case import Case
from warpbrain.cases.specimen import Specimen

#: Files, names and roles; radius and height of the glued cylinder [m].
FILES = {
    "2_comp_ten_cyc_l1_c1.csv": ("cycle 1", "fit"),
    "3_comp_ten_cyc_l1_c2.csv": ("cycle 2", "fit"),
    "4_comp_ten_cyc_l1_c3.csv": ("cycle 3", "check"),
    "6_comp_ten_rel_l1.csv": ("hold", "check"),
}
RADIUS, HEIGHT = 4.0e-3, 4.54144e-3


def case_of(data: Path) -> Case:
    """The first two cycles to fit; the third and the hold are never fitted."""
    tests = []
    for file, (name, role) in FILES.items():
        table = np.genfromtxt(data / file, delimiter=",", names=True)
        axes = ("displacement", "force")
        tests.append(recorded_test(name, "axial", axes, table["displacement"], table["force"], table["time"], role))
    specimen = Specimen("cylinder", (2.0 * RADIUS, 2.0 * RADIUS, HEIGHT), "glued")
    return declared("cortex-specimen", "Human frontal cortex, one specimen", specimen, 1000.0, 0.45, tests)


def main() -> None:
    """Diagnose, write, draw."""
    import matplotlib.pyplot as plt

    options = arguments(__doc__.splitlines()[0])
    found, said = diagnose(case_of(options.data), options.out)
    write_results("real_cortex_specimen", {"cortex specimen": row(found, said)})
    figure, axes = plt.subplots(2, 2, figsize=(9.0, 6.4), layout="constrained")
    for number, axis in enumerate(axes.ravel()):
        draw(axis, found, number, "time", ("refitted", "explained"))
    axes[0, 0].legend(frameon=False, fontsize=8)
    keep_figure(figure, "real-cortex-specimen.png", __file__)


if __name__ == "__main__":
    main()
