"""Parts of an ensemble that end the worker that computes them; imported by the workers."""

import os

from warpbrain.ensemble.workers import compute_part

#: Number of the sample that is deadly.
DEADLY = 1


def compute(part, device, batch, prepare):
    if any(sample.number == DEADLY for sample in part.samples):
        os._exit(9)
    return compute_part(part, device, batch, prepare)
