"""What the hierarchical model learns from: the secant moduli of each study, at as few stretches as say it all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.gp.literature.groups import ANATOMIES, METHODS
from warpbrain.gp.literature.study import Study
from warpbrain.gp.secant import log_secant_modulus

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: A curve of a hyperelastic study is seen at this many stretches. It has one to eight parameters: a hundred points of
#: it are not a hundred observations.
STRETCHES = 10


@dataclass(frozen=True, eq=False)
class Places:
    """Where a secant modulus is looked at.

    Attributes
    ----------
    study, source, task : (n,) int array
        Numbers that tell studies and the papers they come from apart (negative: new ones), and the group.
    stretch : (n,) array
    symmetric : (n,) bool array
        The study's form takes tension and compression alike (`Study.symmetric`): of asymmetry it says nothing.
    """

    study: Integers
    source: Integers
    task: Integers
    stretch: Floats
    symmetric: NDArray[np.bool_]

    @property
    def asymmetric(self) -> NDArray[np.bool_]:
        """Curved, and free to be stiffer on one side of rest."""
        return self.curved & ~self.symmetric

    @property
    def curved(self) -> NDArray[np.bool_]:
        """Hyperelastic: elsewhere only a modulus was published."""
        return self.task // len(ANATOMIES) == METHODS.index("hyperelastic")


@dataclass(frozen=True, eq=False)
class Observations:
    """Secant moduli of studies.

    Attributes
    ----------
    places : Places
    log_modulus : (n,) array
        `z = ln(Psi / I)`, moduli in Pa.
    """

    places: Places
    log_modulus: Floats


def observations(studies: Sequence[Study]) -> Observations:
    """Secant moduli: `STRETCHES` for a hyperelastic study, one for another."""
    names = papers(studies)
    places, moduli = [], []
    for index, study in enumerate(studies):
        grid = _stretches(study)
        values = log_secant_modulus(grid, study.energy(grid))
        if not study.group.startswith("hyperelastic/"):
            grid, values = np.ones(1), values.mean(keepdims=True)
        source = names.index(study.paper)
        places += [(index, source, study.task, l, study.symmetric) for l in grid]
        moduli.append(values)
    table = np.array(places, dtype=np.float64).reshape(-1, 5)
    whole = table[:, :3].astype(np.int64)
    at = Places(whole[:, 0], whole[:, 1], whole[:, 2], table[:, 3], table[:, 4] == 1.0)
    return Observations(at, np.concatenate([*moduli, np.empty(0)]))


def papers(studies: Sequence[Study]) -> list[str]:
    """The papers that studies are from; the place of one is its number in `Places.source`."""
    return sorted({study.paper for study in studies})


def _stretches(study: Study) -> Floats:
    """The middles of equal parts of its range, so that neither 1 nor an end is among them."""
    low, high = study.stretch
    if not study.group.startswith("hyperelastic/"):
        return np.array([low, high])
    half = STRETCHES // 2
    middle = (np.arange(half) + 0.5) / half
    return np.concatenate([low + (1.0 - low) * middle, 1.0 + (high - 1.0) * middle])
