"""The points that the generative model learns from: stretch, logarithm of energy, and the group of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.gp.literature.energies import Floats
from warpbrain.gp.literature.groups import GROUPS
from warpbrain.gp.literature.study import Study

Integers = NDArray[np.int64]

#: Added to an energy before its logarithm is taken [Pa].
OFFSET = 1e-4


@dataclass(frozen=True)
class Dataset:
    """Training points, the studies one after the other.

    Attributes
    ----------
    task : (n,) array of int
        Group of each point, `4 method + anatomy`, 0 to 11.
    stretch : (n,) array
    log_energy : (n,) array
        `y = ln(Psi + 1e-4)`, energies in Pa.
    study : (n,) array of int
        Index of the study in the sequence that the dataset was made from.
    """

    task: Integers
    stretch: Floats
    log_energy: Floats
    study: Integers

    def __len__(self) -> int:
        return len(self.stretch)

    def curves(self) -> tuple[int, ...]:
        """Number of studies in each of the 12 tasks."""
        _, points = np.unique(self.study, return_index=True)
        return tuple(np.bincount(self.task[points], minlength=len(GROUPS)).tolist())


def dataset(studies: Sequence[Study], count: int = 100) -> Dataset:
    """The points of studies, `count` for each (`Study.grid`).

    Examples
    --------
    >>> from warpbrain.gp.literature.studies import read_studies
    >>> points = dataset(read_studies("as_published"))
    >>> len(points), points.curves()
    (7300, (5, 5, 1, 1, 1, 1, 16, 7, 10, 10, 15, 1))
    """
    grids = [study.grid(count) for study in studies]
    energies = [study.energy(grid) for study, grid in zip(studies, grids, strict=True)]
    return Dataset(
        task=np.repeat(np.array([study.task for study in studies], dtype=np.int64), count),
        stretch=np.concatenate([*grids, np.empty(0)]),
        log_energy=np.log(np.concatenate([*energies, np.empty(0)]) + OFFSET),
        study=np.repeat(np.arange(len(studies), dtype=np.int64), count),
    )
