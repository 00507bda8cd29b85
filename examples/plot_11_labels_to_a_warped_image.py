"""
From labels to a warped image
=============================

A head whose labels are FreeSurfer's: a case from them, a simulation in which the brain sags by millimetres, and the
scan as it is then. The three commands are those of ``examples/there_and_back.py`` of the repository, which makes a
small scan first and is what runs here; with a scan of your own they are the same. 3D Slicer opens what is written.
"""

import runpy
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import nibabel

here = Path(sys.path[0] if "__file__" not in globals() else __file__).parent
script = next(folder / "there_and_back.py" for folder in (here, Path.cwd()) if (folder / "there_and_back.py").exists())
folder = Path(tempfile.mkdtemp())
runpy.run_path(str(script))["main"](folder)
print(*sorted(path.name for path in (folder / "result").iterdir()), sep="\n")

# %%
# The scan before and after, cut in the middle: the head lies on its back, so the front has sunk.

before, after = (nibabel.load(path) for path in (folder / "T1.nii.gz", folder / "result" / "T1-after.nii.gz"))
figure, panels = plt.subplots(1, 3, figsize=(11, 4), layout="constrained")
middle = before.shape[0] // 2
for axes, title, image in zip(panels, ("before", "after"), (before, after), strict=False):
    axes.imshow(image.get_fdata()[middle].T, origin="lower", cmap="gray")
    axes.set_title(title)
change = after.get_fdata()[middle] - before.get_fdata()[middle]
panels[2].imshow(change.T, origin="lower", cmap="RdBu", vmin=-100.0, vmax=100.0)
panels[2].set_title("after less before")
for axes in panels:
    axes.set_axis_off()
plt.show()
