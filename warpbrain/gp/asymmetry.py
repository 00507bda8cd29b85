"""Whether tissue is stiffer in compression or in tension: by published energies, and by what a model makes of them.

The asymmetry of an energy is `ln(Psi(l+) / Psi(l-))`, the logarithm of the ratio of secant moduli in tension and in
compression, at stretches of equal I1: zero for any function of I1 alone, such as the neo-Hookean energy, negative where
compression is stiffer. Here it is the mean of that over `STRAINS` of the largest equivalent strain that a range of
stretches has on both sides.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.gp.hierarchy import REACH, Hierarchical
from warpbrain.gp.literature.study import STRETCHES, Study, equivalent_strain, invariant, stretch_of

#: Parts of the largest strain at which both sides are compared: the middles of five equal ones.
STRAINS = (np.arange(5) + 0.5) / 5.0
#: Of an asymmetry: what is smaller is rounding of symmetric energies.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Asymmetry:
    """What a model says of a group."""

    group: str
    strain: float  # largest equivalent strain of the group on both sides
    mean: float  # of all papers
    low: float  # 95 % posterior interval of that
    high: float
    new_low: float  # 95 % of new studies by new papers are between these
    new_high: float
    tension: float  # part of those that is stiffer in tension


def asymmetry(model: Hierarchical, group: str) -> Asymmetry:
    """The asymmetry of a hyperelastic group, without the error of a finite number of draws."""
    from scipy.special import ndtr

    strain = _largest_strain(STRETCHES[group])
    # of a and b
    weights = 2.0 * np.array([np.tanh(STRAINS * strain / REACH).mean(), 1.0])
    everyone = [_along(weights, *each.mean_asymmetry()) for each in model.conditionals]
    sides = np.repeat([-1.0, 1.0], len(STRAINS)) / len(STRAINS)
    new = [_along(sides, *moments) for moments in model.moments(model.places([group], _both_sides(strain)))]
    return Asymmetry(
        group,
        strain,
        float(np.mean([mean for mean, _ in everyone])),
        _quantile(everyone, 0.025),
        _quantile(everyone, 0.975),
        _quantile(new, 0.025),
        _quantile(new, 0.975),
        float(np.mean([ndtr(mean / spread) for mean, spread in new])),
    )


def asymmetry_of(study: Study) -> float:
    """Of a published energy, within its own range."""
    stretches = _both_sides(_largest_strain(study.stretch))
    compression, tension = np.split(np.log(study.energy(stretches) / invariant(stretches)), 2)
    mean = float(np.mean(tension - compression))
    return 0.0 if abs(mean) < _ROUNDING else mean


def asymmetries_of_papers(studies: Iterable[Study]) -> dict[str, tuple[float, bool]]:
    """The mean asymmetry of the hyperelastic studies of each paper, and whether a form of one could have another."""
    papers: dict[str, list[Study]] = {}
    for study in studies:
        if study.hyperelastic:
            papers.setdefault(study.paper, []).append(study)
    return {
        name: (float(np.mean([asymmetry_of(study) for study in of])), not all(study.symmetric for study in of))
        for name, of in papers.items()
    }


def _largest_strain(stretch: Sequence[float]) -> float:
    low, high = equivalent_strain(stretch)
    return float(min(-low, high))


def _both_sides(strain: float) -> Floats:
    return np.concatenate([stretch_of(-strain * STRAINS), stretch_of(strain * STRAINS)])


def _along(weights: Floats, mean: Floats, covariance: Floats) -> tuple[float, float]:
    return float(weights @ mean), float(np.sqrt(weights @ covariance @ weights))


def _quantile(normals: Sequence[tuple[float, float]], part: float) -> float:
    """Of a mixture of normal distributions of equal weight."""
    from scipy.optimize import brentq
    from scipy.special import ndtr

    means, spreads = np.array(normals).T
    if not spreads.any():
        return float(means.mean())
    low, high = means.min() - 12.0 * spreads.max(), means.max() + 12.0 * spreads.max()
    return float(brentq(lambda value: ndtr((value - means) / spreads).mean() - part, low, high))
