"""
A specimen test
===============

A cylinder of tissue between two platens, glued to them: what a law makes of a test, beside what a testing machine
recorded. The rows here are made from another law, with noise, so that the answer is known.
"""

import tempfile
from pathlib import Path

import numpy as np

import warpbrain as wb

CASE = """
[case]
name = "cylinder"
title = "A cylinder of cortex, glued"
origin = "synthetic"
[tissue.1]
name = "cortex"
model = "{model}"
{keys}
[body]
density = 1040.0
poisson = 0.45
[specimen]
shape = "cylinder"
radius = 4.0
height = 4.5
grips = "glued"
[[recording]]
name = "compression"
kind = "test"
mode = "axial"
file = "compression.csv"
[[recording]]
name = "shear"
kind = "test"
mode = "shear"
file = "shear.csv"
"""
folder = Path(tempfile.mkdtemp())
strains = np.linspace(0.0, 0.15, 7)
for name, displacements in {"compression": -4.5 * strains, "shear": 4.5 * 1.5 * strains}.items():
    rows = np.column_stack([displacements, np.zeros(7)])
    np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header="displacement,force", comments="")

# %%
# The machine: an Ogden law that stiffens, and 2 % of noise.

(folder / "case.toml").write_text(CASE.format(model="ogden", keys="mu = [-86.4]\nalpha = [-16.2]"))
truth = wb.run(folder, device="cpu")
rng = np.random.default_rng(3)
for test in truth.tests:
    force = test.result.predicted + 0.02 * np.abs(test.result.predicted).max() * rng.normal(size=7)
    rows = np.column_stack([1000.0 * test.recording.imposed, force])
    np.savetxt(folder / f"{test.recording.name}.csv", rows, delimiter=",", header="displacement,force", comments="")

# %%
# What a neo-Hookean law of the same shear modulus makes of it: too soft where it is strained much.

(folder / "case.toml").write_text(CASE.format(model="neo-hookean", keys="mu = 700.0"))
done = wb.run(folder, device="cpu")
done

# %%

figure = done.plot()
figure

# %%
# The law that made them.

(folder / "case.toml").write_text(CASE.format(model="ogden", keys="mu = [-86.4]\nalpha = [-16.2]"))
figure = wb.run(folder, device="cpu").plot()
figure
