"""
Posterior of two moduli
=======================

Grey and white matter from points that were tracked in a body: the most probable shear moduli, their intervals, and how
much of that came from the data and how much from the literature.
"""

import warpbrain as wb

case = wb.cases["0684"]
# the mesh is taken for exact, and the posterior is checked by fewer draws than `warpbrain estimate` takes
options = wb.EstimationOptions(samples=25, discretisation=None)
posterior = wb.estimate(case, options=options, device="cpu")
posterior

# %%
# Before (the literature) and after.

figure = posterior.plot(field="moduli")
figure

# %%
# What is not known of tissue is not known of the displacement either: its standard deviation.

posterior.plot(field="displacement_sd", cut="y")
