"""
The paper's Table 3 and Figure of spread
========================================

Elapsed times of a step of the phantom's motion beside those that the paper publishes (supplement, Table 3: Intel Core
i7 at 2.8 GHz with a GeForce GTX 1060), and the spread of a displacement over the paper's sweep: the curves of -2 to 2
standard deviations of its generative model.
"""

import matplotlib.pyplot as plt
import numpy as np

import warpbrain as wb
from warpbrain.bench.table3 import TABLE3
from warpbrain.simulation.dynamics import PHASES

STEPS = 30
device = None  # a GPU if there is one
measured = {}
for name, row in TABLE3.items():
    wb.run(row.case, tissue=row.tissue, steps=1, device=device)  # kernels are compiled
    done = wb.run(row.case, tissue=row.tissue, steps=STEPS, device=device)
    measured[name] = {phase: 1000.0 * done.followed.seconds[phase] / STEPS for phase in PHASES}

# %%
# `python -m warpbrain.bench` writes the whole table, with pre-processing of meshes that no cache has seen.

print(f"{'mesh':<10}" + "".join(f"{phase:>24}" for phase in PHASES) + "   [ms], paper in brackets")
for name, phases in measured.items():
    cells = (f"{phases[phase]:.2f} ({TABLE3[name].phases[phase][0]:.1f})" for phase in PHASES)
    print(f"{name:<10}" + "".join(f"{cell:>24}" for cell in cells))

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
at = np.arange(len(measured))
ours = [sum(phases.values()) for phases in measured.values()]
paper = [sum(TABLE3[name].phases[phase][0] for phase in PHASES) for name in measured]
axes.bar(at, paper, 0.4, label="paper, GTX 1060", color="#E69F00")
axes.bar(at + 0.4, ours, 0.4, label="here", color="#0072B2")
axes.set_xticks(at + 0.2, list(measured))
axes.set_yscale("log")
axes.set_ylabel("one step [ms]")
axes.legend()
plt.show()

# %%
# The spread over the sweep, of a stand-in with one tissue: 17 laws, to rest.

spread = wb.ensemble("0684", samples="grid", tissue="single", device=device)
deviations = [row.sample.deviations[1] for row in spread.done]
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for name in spread.displacement:
    axes.plot(deviations, [1000.0 * row.displacement[name].mean for row in spread.done], ".-", label=name)
axes.set_xlabel("standard deviations from the mean curve of the generative model")
axes.set_ylabel("mean displacement [mm]")
axes.legend()
plt.show()

# %%

spread.plot(field="displacement_sd", cut="y")
