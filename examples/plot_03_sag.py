"""
Brain sag after drainage
========================

When the dura is open and cerebrospinal fluid runs out, the brain carries weight that the fluid carried before, and
sinks: by 5.7 mm in the mean, as Miga et al. (1999) found in surgery. Here the phantom lies on its back, and the level
of the fluid falls.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import warpbrain as wb

MEASURED = 5.7  # mm, Miga et al. 1999

case = replace(wb.find_case("phantom", "single"), mechanisms=())
# no force on the cap: what sinks is the brain alone, supine
case = replace(
    case, boundaries=tuple(b for b in case.boundaries if b.name != "superior cap"), gravity_axis=(0.0, -1.0, 0.0)
)
print(*case.assumptions, sep="\n")

levels = (160, 140, 120, 100)
states = {}
for level in levels:
    sinking = wb.assume(case.with_shear_moduli({1: 900.0}), f"gravity:csf_level={level}")
    states[level] = wb.run(sinking, device="cpu")

# %%
# How far the top of the exposed brain, in front, sinks with each level.

front = case.mesh.points[:, 1] > np.percentile(case.mesh.points[:, 1], 97.0)
sag = [-1000.0 * states[level].u[front, 1].mean() for level in levels]
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
axes.plot(levels, sag, "o-", color="#0072B2", label="mean sag of the uppermost 3 % of nodes")
axes.axhline(MEASURED, color="#D55E00", linestyle="--", label="Miga et al. 1999, mean")
axes.invert_xaxis()
axes.set_xlabel("level of the fluid above the lowest point [mm]")
axes.set_ylabel("sag [mm]")
axes.legend()
plt.show()

# %%
# Fluid at 120 mm: the shape is drawn three times as far from where it was.

states[120].plot(exaggeration=3.0)
