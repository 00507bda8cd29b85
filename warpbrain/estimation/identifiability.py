"""What the data inform and what they do not, in words.

A direction is told if the data know more of it than the prior did (gain at least 1: the variance at least halves), and
hidden if they know less than a tenth of that: an estimate along it is the prior, and no finding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.fit import Estimate
from warpbrain.estimation.parameters import Parameter
from warpbrain.physics.words import enumerated

#: Gains from which a direction is told, and below which it is hidden.
TOLD, HIDDEN = 1.0, 0.1
#: Parts of a direction smaller than this, in standard deviations of the prior, are not spoken of.
_NEGLIGIBLE = 0.1
#: A change of the moduli that moves the body by less than this part of its displacement moves nothing.
_UNMOVED = 1e-4
#: Two parts of a direction that differ by less than this are the same.
_ALIKE = 0.1
#: How a combination of parameters is told, and a change: of one, of moduli alike, of any.
_COMBINATION = "the {}", "the geometric mean of the shear moduli of {}", "the combination {}"
_CHANGE = "a change of the {}", "a change of the shear moduli of {} by one factor", "a change along {}"


@dataclass(frozen=True)
class Identifiability:
    """A verdict."""

    informed: tuple[str, ...]  # combinations of parameters that the data tell
    weakly_informed: tuple[str, ...]  # and that they tell a little
    hidden: tuple[str, ...]  # changes of the parameters that the data do not see
    #: All shear moduli together can be changed by a factor, and the data do not see it: the loads are displacements
    #: only, and no force was recorded
    scale_is_hidden: bool

    @property
    def nothing(self) -> bool:
        """The data say nothing: the posterior is the prior."""
        return not self.informed and not self.weakly_informed

    @property
    def sentences(self) -> tuple[str, ...]:
        """For people to read."""
        sentences = []
        if self.nothing:
            sentences.append(
                "Not identifiable: the recordings say nothing of the tissue. What is given is the prior, no finding."
            )
        if self.informed:
            sentences.append(f"The recordings inform {enumerated(self.informed)}.")
        if self.weakly_informed:
            sentences.append(f"They inform a little {enumerated(self.weakly_informed)}.")
        if self.hidden and not self.nothing:
            sentences.append(f"They do not see {enumerated(self.hidden)}: there the estimate is the prior.")
        if self.scale_is_hidden:
            sentences.append(
                "Absolute stiffness cannot be told from displacements that displacements cause: a recorded force, or a "
                "load that is known, such as weight, would tell it."
            )
        return tuple(sentences)


def identifiability(estimate: Estimate) -> Identifiability:
    """What the data of an estimate inform."""
    posterior = estimate.laplace
    parameters, gains = tuple(posterior.parameters), posterior.gains
    told, hidden = gains >= TOLD, gains < HIDDEN
    # one prior standard deviation of a parameter is the unit in which changes of different kinds compare
    unit = posterior.prior.standard_deviations
    # a factor on all moduli moves nothing if displacements do it all, and everything under a weight or a force
    scale = posterior.parameters.is_modulus.astype(np.float64)
    moved = np.linalg.norm(np.tensordot(scale, estimate.linearised.du, axes=1))
    known = float(scale @ posterior.information @ scale) / float(scale @ posterior.prior.precision @ scale)

    def combinations(rows: Floats) -> tuple[str, ...]:
        return tuple(in_words(parameters, row / unit, _COMBINATION) for row in _reduced(rows * unit))

    return Identifiability(
        combinations(posterior.combinations[told]),
        combinations(posterior.combinations[~told & ~hidden]),
        tuple(in_words(parameters, row * unit, _CHANGE) for row in _reduced(posterior.directions[hidden] / unit)),
        known < HIDDEN and bool(moved <= _UNMOVED * np.linalg.norm(estimate.point.state.u)),
    )


def _reduced(rows: Floats) -> Floats:
    """Other rows of the same span, each with a 1 where the others have zeros: the fewest parameters in each."""
    rows = rows.copy()
    for k in range(len(rows)):
        column = int(np.abs(rows[k]).argmax())
        rows[k] /= rows[k, column]
        others = np.arange(len(rows)) != k
        rows[others] -= np.outer(rows[others, column], rows[k])
    return np.where(np.abs(rows) >= _NEGLIGIBLE * np.abs(rows).max(axis=1, keepdims=True, initial=0.0), rows, 0.0)


def in_words(parameters: Sequence[Parameter], row: Floats, words: tuple[str, str, str]) -> str:
    """A direction (p,) in parameters of their own units; those with a weight of zero are not in it."""
    single, alike, other = words
    weights = row / row[np.abs(row).argmax()]
    parts = [(parameters[k], float(weights[k])) for k in np.flatnonzero(weights).tolist()]
    if len(parts) == 1:
        return single.format(f"{parts[0][0].coordinate.noun} of {parts[0][0].tissue}")
    if all(parameter.is_modulus for parameter, _ in parts):
        tissues = enumerated([parameter.tissue for parameter, _ in parts])
        if max(weight for _, weight in parts) - min(weight for _, weight in parts) < _ALIKE:
            return alike.format(tissues)
        if len(parts) == 2 and abs(parts[0][1] + parts[1][1]) < _ALIKE:
            return single.format(f"ratio of the shear moduli of {tissues}")
    return other.format(" ".join(f"{weight:+.2g} [{parameter.name}]" for parameter, weight in parts))
