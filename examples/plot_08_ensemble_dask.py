"""
An ensemble with Dask
=====================

How much of a displacement is tissue that nobody has measured? Draws of what 73 published strain energies make likely,
simulated together over the workers of a Dask cluster. With ``folder=...`` a call that was killed goes on with what is
missing.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import warpbrain as wb

# %%
# A cluster: here a scheduler and two workers on this machine, started as on any other. ``dask="local:2"`` starts two
# processes without all this, in a script that guards its work by ``if __name__ == "__main__":``.

file = Path(tempfile.mkdtemp()) / "scheduler.json"
dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard"]
worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--nthreads", "1", "--no-dashboard"]
quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
cluster = [subprocess.Popen([*dask, "--scheduler-file", str(file)], **quiet)]
cluster += [subprocess.Popen([*worker, "--scheduler-file", str(file)], **quiet) for _ in range(2)]
while not file.exists():
    time.sleep(0.1)

# %%
# The call is the same wherever the scheduler is.

try:
    address = json.loads(file.read_text())["address"]
    spread = wb.ensemble("0684", samples=12, tissue="single", dask=address, device="cpu")
finally:
    for process in cluster:
        process.terminate()
        process.wait()
spread

# %%
# The standard deviation of the displacement over these laws.

spread.plot(field="displacement_sd", cut="y")

# %%
# And how well each explains what was recorded.

moduli = [law.law.shear_modulus for row in spread.done for law in [next(iter(row.sample.materials.values()))]]
figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
for name in spread.errors:
    axes.plot(moduli, [1000.0 * row.error(name) for row in spread.done], "o", label=name)
axes.set_xscale("log")
axes.xaxis.set_minor_formatter("")
axes.set_xlabel("shear modulus [Pa]")
axes.set_ylabel("RMSE [mm]")
axes.legend()
plt.show()
assert np.isfinite(moduli).all()
