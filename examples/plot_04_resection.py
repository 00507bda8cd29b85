"""
A resection
===========

A temporal lobe was taken out. What is left is computed with its cavity; the recorded wall of the cavity says that the
declared case moves far too little.
"""

import matplotlib.pyplot as plt

import warpbrain as wb

case = wb.cases["0529"]
case

# %%
# The anatomy, with the tissue that was taken out (1).

case.plot(field="resection", cut=None, view=(-1.0, 0.7, -0.1))

# %%
# The simulated state of what is left.

done = wb.run(case, device="cpu")
done.plot(cut=None, exaggeration=20.0, view=(-1.0, 0.7, -0.1))

# %%
# A plausible guess is no diagnosis: that fluid has drained to 60 mm explains both recordings worse than no motion.

drained = wb.run(wb.assume(case, "gravity:csf_level=60"), device="cpu")
names = list(done.errors)
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
for offset, (label, errors) in enumerate({"declared": done.errors, "and fluid has drained": drained.errors}.items()):
    axes.bar([k + 0.3 * offset for k in range(len(names))], [1000.0 * errors[n][1] for n in names], 0.3, label=label)
for k, name in enumerate(names):
    axes.plot(
        [k - 0.2, k + 0.5], 2 * [1000.0 * done.errors[name][0]], "k--", label="no motion at all" if not k else None
    )
axes.set_xticks([k + 0.15 for k in range(len(names))], names)
axes.set_ylabel("RMSE at the recordings [mm]")
axes.legend()
plt.show()
