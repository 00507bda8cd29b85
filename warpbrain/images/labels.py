"""A volume of labels: an image whose values are whole numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError
from warpbrain.images.reading import Image


def labels_of(image: Image) -> NDArray[np.int32]:
    """The labels (i, j, k) of an image, zero is background.

    Raises
    ------
    InputError
        If its values are not all whole numbers of zero or more.
    """
    path, values = image.path, image.values
    with np.errstate(invalid="ignore"):
        labels = values.astype(np.int32)
    wrong = labels != values
    if wrong.any():
        raise InputError(
            f"{path}: expected whole numbers as labels, found {np.count_nonzero(wrong)} voxels of {wrong.size} "
            f"that are none, such as {values[wrong][0]:g}: a probability map, or resampled with interpolation?"
        )
    if labels.min() < 0:
        raise InputError(f"{path}: expected labels of 0 or more, found {labels.min()}")
    return labels
