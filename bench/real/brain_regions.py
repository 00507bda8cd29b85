"""Four regions of the human brain, declared neo-Hookean: each loading mode in turn predicted from the others.

    python bench/real/brain_regions.py DATA --out proof

DATA holds `REGION_axial.csv` (stretch, stress [Pa]) and `REGION_shear.csv` (shear, stress [Pa]), see
docs/proof-recordings.md. Writes `results/real_brain_regions.json` and `docs/figures/real-brain-regions.png`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from common import arguments, declared, diagnose, draw, keep_figure, recorded_test, row, write_results

from warpbrain.cases.case import Case
from warpbrain.cases.specimen import Specimen

REGIONS = ("cortex", "corona_radiata", "basal_ganglia", "corpus_callosum")
#: Side of the glued cubes [m].
SIDE = 5.0e-3


def case_of(data: Path, region: str) -> Case:
    """Tension, compression and shear; of the shear the positive half, whose mirror image the other one is."""
    axial, shear = (
        np.genfromtxt(data / f"{region}_{mode}.csv", delimiter=",", names=True, skip_header=1)
        for mode in ("axial", "shear")
    )
    tests = []
    for name, own in (("tension", axial["stretch"] >= 1.0), ("compression", axial["stretch"] <= 1.0)):
        order = np.argsort(np.abs(axial["stretch"][own] - 1.0))
        stretch, stress = axial["stretch"][own][order], axial["stress"][own][order]
        tests.append(recorded_test(name, "axial", ("stretch", "stress"), stretch, stress))
    own = shear["shear"] >= 0.0
    axes = ("displacement", "force")
    tests.append(recorded_test("shear", "shear", axes, SIDE * shear["shear"][own], SIDE**2 * shear["stress"][own]))
    name = region.replace("_", "-")
    specimen = Specimen("block", (SIDE, SIDE, SIDE), "glued")
    return declared(name, f"Human {region.replace('_', ' ')}, mean of specimens", specimen, 700.0, 0.45, tests)


def main() -> None:
    """Diagnose, write, draw."""
    import matplotlib.pyplot as plt

    options = arguments(__doc__.splitlines()[0])
    rows = {}
    figure, axes = plt.subplots(4, 3, figsize=(9.0, 10.5), layout="constrained")
    for line, region in zip(axes, REGIONS, strict=True):
        rows[f"{region}, glued ends computed"] = row(*diagnose(case_of(options.data, region), options.out))
        # as the published evaluation has it, which the published means are of
        found, said = diagnose(case_of(options.data, region), options.out, ends=False)
        rows[f"{region}, homogeneous"] = row(found, said)
        for number, axis in enumerate(line):
            draw(axis, found, number, "strain", ("heldout refitted", "heldout explained"))
            axis.set_title(f"{region.replace('_', ' ')}: {axis.get_title()} from the others", fontsize=8)
    # what was added is not in every panel
    lines = {line.get_label(): line for axis in axes.flat for line in axis.get_legend_handles_labels()[0]}
    axes[0, 1].legend(handles=list(lines.values()), frameon=False, fontsize=8, loc="lower right")
    write_results("real_brain_regions", rows)
    keep_figure(figure, "real-brain-regions.png", __file__)


if __name__ == "__main__":
    main()
