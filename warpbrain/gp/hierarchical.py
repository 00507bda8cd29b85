"""The hierarchical model: studies differ as wholes, not point by point.

The paper's process takes what studies of a group differ by for noise that is independent at every stretch. A hundred
points of five curves then pin the group down as five hundred observations would, and a joint draw is jagged. Here a
study, and the paper it is from, is an effect (`hierarchy`), so the spread of a new study is a spread of whole curves.
How far studies and papers differ is itself known from few: predictions are averaged over a sample of hierarchies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.gp.conditional import Conditional, Structures
from warpbrain.gp.drawing import standard_normal
from warpbrain.gp.hierarchy import Hierarchy
from warpbrain.gp.literature.groups import GROUPS, task_of
from warpbrain.gp.literature.study import Study
from warpbrain.gp.observations import Places, observations, papers
from warpbrain.gp.secant import log_energy

Floats = NDArray[np.float64]

#: Stretches at which draws are drawn; between them they are the mean given these values.
ANCHORS = np.linspace(0.4, 1.8, 57)


@dataclass(frozen=True, eq=False)
class Hierarchical:
    """The hierarchical model of a set of studies (a `warpbrain.gp.process.Process`).

    Attributes
    ----------
    studies : tuple of Study
    hierarchy : Hierarchy
        Of largest posterior density.
    variant : str
        Of the literature.
    sample : tuple of Hierarchy
        Drawn from the posterior; predictions are averaged over them, and a draw is of one of them. Empty: `hierarchy`
        stands for all.
    """

    studies: tuple[Study, ...]
    hierarchy: Hierarchy
    variant: str = "corrected"
    sample: tuple[Hierarchy, ...] = ()
    name = "hierarchical"

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups that it has seen studies of."""
        seen = {study.group for study in self.studies}
        return tuple(group for group in GROUPS if group in seen)

    def modulus(self, groups: Sequence[str], stretches: ArrayLike) -> tuple[Floats, Floats]:
        """Mean (groups, n) and covariance (groups * n, groups * n) of the log secant modulus of a new study.

        All groups are measured by one new paper, as in one subject.
        """
        mean, covariance = _mixed(self.moments(self.places(groups, stretches)))
        return mean.reshape(len(groups), -1), covariance

    def moduli_of(self, studies: Sequence[Study], stretches: Sequence[Floats]) -> list[tuple[Floats, Floats]]:
        """Mean and covariance, under each hierarchy, of log secant moduli of studies that it has not seen.

        Joint over studies, each at its own stretches. Where it has seen others of the same paper, these count.
        """
        known = papers(self.studies)
        new = sorted({study.paper for study in studies} - set(known))
        sources = {**{name: index for index, name in enumerate(known)}, **{n: -1 - k for k, n in enumerate(new)}}
        rows = [
            (-1 - index, sources[study.paper], study.task, l, study.symmetric)
            for index, (study, own) in enumerate(zip(studies, stretches, strict=True))
            for l in own
        ]
        return self.moments(_places(rows))

    def moments(self, at: Places) -> list[tuple[Floats, Floats]]:
        """Mean (n,) and covariance (n, n) of the log secant modulus at places, under each hierarchy."""
        structures = Structures.of(self._seen, at)
        return [each.moments(structures) for each in self.conditionals]

    @staticmethod
    def places(groups: Sequence[str], stretches: ArrayLike) -> Places:
        """Places (groups * n) of one new paper, with one new study a group, free to be asymmetric."""
        l = np.asarray(stretches, dtype=np.float64)
        numbered = enumerate(map(task_of, groups))
        return _places([(-1 - index, -1, task, stretch, False) for index, task in numbered for stretch in l])

    def curve(self, group: str, stretches: ArrayLike, k: ArrayLike = 0.0) -> Floats:
        """The curve `k` standard deviations from the mean, see `Process`."""
        mean, covariance = self.modulus([group], stretches)
        away = np.multiply.outer(np.asarray(k, dtype=np.float64), np.sqrt(np.diag(covariance)))
        return log_energy(stretches, mean[0] + away)

    def draw(self, groups: Sequence[str], stretches: ArrayLike, number: int | tuple[int, ...], seed: int = 0) -> Floats:
        """Draw `number` of a seed, see `Process`."""
        from scipy.special import ndtr

        l, known = np.asarray(stretches, dtype=np.float64), tuple(groups)
        anchors, to_anchors = self._structures(known, l)
        which, *_ = normal = standard_normal(1 + len(anchors.at.b), number, seed)
        one = self.conditionals[min(int(ndtr(which) * len(self.conditionals)), len(self.conditionals) - 1)]
        mean, cross = one.from_anchors((known, l.tobytes()), to_anchors)
        z = mean + cross @ one.anchored(known, anchors).weights(normal[1:])
        return log_energy(l, z.reshape(len(known), -1))

    def _structures(self, groups: tuple[str, ...], stretches: Floats) -> tuple[Structures, Structures]:
        """Of anchors, and of stretches with anchors; the last ones are kept, for many draws at the same stretches."""
        key = groups, stretches.tobytes()
        if key not in self._last:
            self._last.clear()
            anchors, at = self.places(groups, ANCHORS), self.places(groups, stretches)
            self._last[key] = Structures.of(self._seen, anchors), Structures.of(self._seen, at, anchors)
        return self._last[key]

    @cached_property
    def _last(self) -> dict[tuple[tuple[str, ...], bytes], tuple[Structures, Structures]]:
        return {}

    @cached_property
    def _seen(self) -> Places:
        return observations(self.studies).places

    @cached_property
    def conditionals(self) -> tuple[Conditional, ...]:
        """What is known of moduli under each hierarchy of the sample."""
        seen = observations(self.studies)
        return tuple(Conditional(hierarchy, seen) for hierarchy in self.sample or (self.hierarchy,))


def _mixed(moments: Sequence[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    """Mean and covariance of a mixture of distributions of equal weight."""
    means = np.array([mean for mean, _ in moments])
    away = means - means.mean(axis=0)
    within = np.mean([covariance for _, covariance in moments], axis=0)
    return means.mean(axis=0), within + away.T @ away / len(moments)


def _places(rows: Sequence[tuple[int, int, int, float, bool]]) -> Places:
    study, source, task, stretch, symmetric = (np.array(column) for column in zip(*rows, strict=True))
    return Places(study, source, task, stretch, symmetric)
