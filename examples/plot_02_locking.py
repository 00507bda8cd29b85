"""
Locking and how to avoid it
===========================

Linear tetrahedra of nearly incompressible material cannot bend and keep their volumes: they lock. A silicone beam with
a Poisson ratio of 0.499 sags under its own weight; markers on it were tracked at ETH Zurich. Four kinds of elements on
the same mesh, beside what was recorded.
"""

import time

import matplotlib.pyplot as plt
import numpy as np

import warpbrain as wb
from warpbrain.recordings.location import locate

case = wb.cases["beam-gravity"]
markers = case.recordings[0]
sags, seconds = {}, {}
# from one end to the other through its middle
low, high = case.mesh.points.min(axis=0), case.mesh.points.max(axis=0)
line = np.linspace(0.0, 1.0, 41)[:, None] * [high[0] - low[0], 0.0, 0.0] + [low[0], *0.5 * (low + high)[1:]]
where = locate(case.mesh.points, case.mesh.tetrahedra, line)
for elements in ("tet4", "tet4-averaged", "tet10", "tet10-mixed"):
    begun = time.perf_counter()
    done = wb.run(case, elements=elements, device="cpu")
    seconds[elements] = time.perf_counter() - begun
    sags[elements] = -1000.0 * (where.matrix(len(case.mesh.points)) @ done.u)[:, 2]
    print(f"{elements:14} RMSE at the markers {1000.0 * done.errors['markers'][1]:.2f} mm, {seconds[elements]:.1f} s")

# %%
# `tet4` is too stiff, most of all where the beam bends. Which elements a run takes if nobody asks, it says.

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
axes.plot(1000.0 * markers.points[:, 0], -1000.0 * markers.displacement[:, 2], "ko", label="recorded")
for elements, sag in sags.items():
    axes.plot(1000.0 * line[:, 0], sag, label=elements)
axes.invert_yaxis()
axes.set_xlabel("along the beam [mm]")
axes.set_ylabel("sag [mm]")
axes.legend()
plt.show()

# %%
# The beam, as it hangs.

done.plot(cut=None)
