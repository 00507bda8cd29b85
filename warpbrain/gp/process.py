"""What every trained generative model can be asked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.gp.literature.study import Study

Floats = NDArray[np.float64]


class Process(Protocol):
    """A distribution over strain energies of tissue, learnt from published ones.

    Curves are logarithms of energy on the incompressible uniaxial path, `y = ln(Psi + 1e-4)`, `Psi` in Pa. They are
    those of a new study of a group: what is not known of the group and what studies of it differ by are both in them.
    """

    @property
    def name(self) -> str:
        """Of the kind of model, as the command line calls it."""
        ...

    @property
    def variant(self) -> str:
        """Of the literature that it learnt from."""
        ...

    @property
    def studies(self) -> tuple[Study, ...]:
        """What it learnt from."""
        ...

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups that it has seen studies of."""
        ...

    def curve(self, group: str, stretches: ArrayLike, k: ArrayLike = 0.0) -> Floats:
        """Curves `k` standard deviations from the mean (the paper's samples), shape of `k` and `stretches` (..., n)."""
        ...

    def draw(self, groups: Sequence[str], stretches: ArrayLike, number: int | tuple[int, ...], seed: int = 0) -> Floats:
        """Draw `number` of a seed, joint over groups: curves of shape (groups, n).

        A draw is a function: its value at a stretch does not depend on the other stretches that were asked for. A
        number of several parts, as (7, 1), is another draw: the first that replaces draw 7.
        """
        ...
