"""Parts of an ensemble that end the worker that computes them, or do not end; imported by the workers."""

import os
import time

from warpbrain.ensemble.workers import compute_part

#: Number of the sample that is deadly.
DEADLY = 1


def compute(part, device, batch, prepare):
    if any(sample.number == DEADLY for sample in part.samples):
        die()
    return compute_part(part, device, batch, prepare)


def compute_without_end(part, device, batch, prepare):
    if any(sample.number == DEADLY for sample in part.samples):
        time.sleep(3600.0)
    return compute_part(part, device, batch, prepare)


def die():
    os._exit(9)
