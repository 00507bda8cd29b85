"""What an ensemble is if nobody says otherwise; apart, since ``--help`` prints it and must not load NumPy."""

from __future__ import annotations

#: Samples of the paper's sweep: as many are drawn if nobody says how many.
SAMPLES = 289
