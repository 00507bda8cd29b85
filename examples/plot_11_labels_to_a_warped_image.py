"""
From labels to a warped image
=============================

Labels as FreeSurfer's of the ICBM 152 template: a case from them, a simulation in which the brain sags by millimetres,
and the scan as it is then. The commands are those of ``examples/there_and_back.py`` of the repository, which makes the
volumes first and is what runs here; with a scan of your own they are the same. 3D Slicer opens what is written.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import nibabel

here = Path(sys.path[0] if "__file__" not in globals() else __file__).parent
script = next(folder / "there_and_back.py" for folder in (here, Path.cwd()) if (folder / "there_and_back.py").exists())
folder = Path(tempfile.mkdtemp())
# elements of 12 mm in the place of 9: half the time
subprocess.run([sys.executable, script, folder, "--size", "12"], check=True, stdout=subprocess.DEVNULL)
print(*sorted(path.name for path in (folder / "result").iterdir()), sep="\n")

# %%
# The scan before and after, cut in the middle: the head lies on its back, so the front has sunk.

before, after = (nibabel.load(path) for path in (folder / "T1.nii.gz", folder / "result" / "T1-after.nii.gz"))
figure, panels = plt.subplots(1, 3, figsize=(11, 4), layout="constrained")
middle = 5 * before.shape[0] // 8
for axes, title, image in zip(panels, ("before", "after"), (before, after), strict=False):
    axes.imshow(image.get_fdata()[middle].T, origin="lower", cmap="gray")
    axes.set_title(title)
change = after.get_fdata()[middle] - before.get_fdata()[middle]
panels[2].imshow(change.T, origin="lower", cmap="RdBu", vmin=-0.5 * change.max(), vmax=0.5 * change.max())
panels[2].set_title("after less before")
for axes in panels:
    axes.set_axis_off()
plt.show()
