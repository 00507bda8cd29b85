"""Default options of an ensemble; in a module without NumPy, which ``warpbrain ensemble --help`` must not load."""

from __future__ import annotations

#: Number of samples: that of the paper's sweep.
SAMPLES = 289
