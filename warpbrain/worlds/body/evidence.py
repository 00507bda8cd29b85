"""The evidence of a set of causes of a body, summed over the sizes of what is known but for how large it is.

Of the mesh's error one part is correlated in space, as what a local cause moves is; another is what the mesh does not
resolve (`warpbrain.estimation.within_element`). The first is relative to the displacement under the set, which is that
of its causes where these move more than all else. And tissue is stiffer in one place than in another, by more or less
from body to body. A set that explains the recordings leaves small sizes; under a wrong set they take up what is left.
With one size for all sets they would hide causes, or be taken for some.
"""

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import beliefs
from warpbrain.inference.marginal import Marginal, RowsAtScales, Summed, marginal_of, outward
from warpbrain.threads import in_threads
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.nuisances import FIELD, UNKNOWN_MESH

#: The sum over sizes ends where a term is below this part of the largest.
_NEGLIGIBLE = 1e-2
#: How often at most the most probable size of each is looked for beside those of the others.
_PASSES = 3


class Sizes(NamedTuple):
    """Indices of sizes, the most probable ones unless said otherwise."""

    mesh: int  # of the part of its error that is correlated in space, of `mesh.unknown`
    unresolved: int  # of what it does not resolve, of `Base.noises`
    field: int  # of the stiffness field, of `Nuisances.field_sizes`


@dataclass(frozen=True, eq=False)
class SetMarginal(Marginal):
    """The evidence of a set, and the most probable sizes."""

    sizes: Sizes


def evidence_of(
    base: Base, columns: Floats, residual: Floats, sizes: Sizes, scale: float = 1.0
) -> tuple[Floats, SetMarginal]:
    """Evidence of residuals, and the columns with the most probable sizes.

    `columns` (n, q): of nuisances and causes. `residual` (n,): less what is expected of the causes. `sizes`: near the
    most probable ones, where sums begin; the columns are of a stiffness field of the size in these. `scale`: a factor
    on the noise near the most probable one. Returns the columns (n, q), and the marginal with these columns and the
    most probable noise; its log evidence is the mean over all sizes.
    """
    return _OverSizes(base, columns, residual, sizes, scale).summed()


def sizes_of(base: Base) -> Sizes:
    """Those of the columns of a base."""
    fractions, nuisances = beliefs("mesh.unknown"), base.nuisances
    return Sizes(int(np.argmin(np.abs(np.log(fractions / nuisances.fraction)))), 0, nuisances.field_sizes.typical)


class _OverSizes:
    """The evidence of one set at any sizes; arguments as of `evidence_of`."""

    def __init__(self, base: Base, columns: Floats, residual: Floats, sizes: Sizes, scale: float) -> None:
        self._base, self._residual, self._scale, nuisances = base, residual, scale, base.nuisances
        # of nothing that moves, or where no displacement was recorded, there is one size of the mesh's error
        self._moving = bool(nuisances.families[UNKNOWN_MESH].any())
        self._fractions = beliefs("mesh.unknown") if self._moving else np.ones(1)
        even = (np.full(count, -np.log(count)) for count in (len(self._fractions), len(base.noises)))
        self._log_prior = dict(zip(Sizes._fields, (*even, nuisances.field_sizes.log_prior), strict=True))
        self._first = sizes if self._moving else sizes._replace(mesh=0)
        self._columns = columns
        self._field = np.r_[nuisances.part(FIELD)]
        self._mesh = np.r_[nuisances.part(UNKNOWN_MESH)] if self._moving else np.zeros(0, dtype=np.int64)
        self._relative = np.zeros((len(residual), 0))
        self._inflation: Floats | None = None
        self._summed: dict[Sizes, Summed] = {}
        self._rows, self._others = cache(self._rows_without), cache(self._without_mesh)
        if self._moving:
            model = self._others(0, self._first.field)
            as_given = RowsAtScales(model, residual, base.points, columns[:, self._mesh]).with_gross_errors(scale)
            self._inflation = as_given.inflation
            moved = _displacement(base, residual - model.columns @ (model.columns.T @ as_given.weighted))
            self._relative = moved[:, None] * nuisances.relative

    def summed(self) -> tuple[Floats, SetMarginal]:
        """See `evidence_of`."""
        best, logs = self._first, {}
        for _ in range(_PASSES):
            before = best
            for axis in Sizes._fields:
                logs[axis] = self._along(axis, best)
                best = best._replace(**{axis: int(np.argmax(logs[axis]))})
            if best == before:
                break
        base, columns = self._base, self._columns_at(best)
        marginal = marginal_of(base.noises[best.unresolved].of_noise(columns), base.points, self._summed[best])
        # as if the evidence were a product of what depends on each of the sizes
        sums = (float(np.logaddexp.reduce(each)) - marginal.log_evidence for each in logs.values())
        log_evidence = marginal.log_evidence + sum(sums)
        return columns, SetMarginal(
            log_evidence, marginal.scale, marginal.inflation, marginal.model, marginal.count, best
        )

    def _along(self, axis: str, at: Sizes) -> Floats:
        """Log evidence plus log prior by the numbers of one of the sizes, where the others stay."""
        first, log_prior = getattr(at, axis), self._log_prior[axis]
        count = len(log_prior)

        def log_evidence(number: int) -> float:
            return self._log_evidence(at._replace(**{axis: number}), axis) + float(log_prior[number])

        log_evidence(first)
        # those that are asked for in any case
        in_threads(log_evidence, [k for k in (first - 1, first + 1) if 0 <= k < count])
        return outward(log_evidence, first, count, _NEGLIGIBLE)

    def _log_evidence(self, sizes: Sizes, axis: str) -> float:
        if sizes not in self._summed:
            # gross errors are nearly the same whatever is smooth; what is not resolved may look like some
            alike = (result for other, result in list(self._summed.items()) if other.unresolved == sizes.unresolved)
            known = next(alike, None)
            near = (self._scale, None if sizes.unresolved else self._inflation)
            near = near if known is None else (known.scale, known.inflation)
            if axis == "field":
                rows, length = self._rows(axis, sizes._replace(field=self._first.field)), self._factor(sizes.field)
            else:
                rows = self._rows("mesh", sizes._replace(mesh=self._first.mesh))
                length = float(self._fractions[sizes.mesh])
            self._summed[sizes] = rows.summed(length, *near)
        return self._summed[sizes].log_evidence

    def _rows_without(self, axis: str, sizes: Sizes) -> RowsAtScales:
        """Rows where the size of the stiffness field, or of the mesh's error, varies; the others are as in `sizes`."""
        if axis == "field":
            others = np.delete(self._columns_at(sizes), self._field, axis=1)
            model, varying = self._base.noises[sizes.unresolved].of_noise(others), self._columns[:, self._field]
        else:
            model, varying = self._others(sizes.unresolved, sizes.field), self._relative
        return RowsAtScales(model, self._residual, self._base.points, varying)

    def _without_mesh(self, unresolved: int, field: int) -> GaussianModel:
        """Model of the rows without columns of the mesh's error, with noise and stiffness field of these sizes."""
        columns = self._base.nuisances.with_field(self._columns, self._factor(field))
        return self._base.noises[unresolved].of_noise(np.delete(columns, self._mesh, axis=1))

    def _factor(self, field: int) -> float:
        """Size of the stiffness field relative to that of the columns as given."""
        of_all = self._base.nuisances.field_sizes.relative
        return float(of_all[field] / of_all[self._first.field])

    def _columns_at(self, sizes: Sizes) -> Floats:
        nuisances = self._base.nuisances
        columns = nuisances.with_field(self._columns, self._factor(sizes.field))
        if self._moving:
            columns[:, self._mesh] = self._fractions[sizes.mesh] * self._relative
        return columns


def _displacement(base: Base, left: Floats) -> Floats:
    """Of the rows (n,) [m], all that was recorded of a point, where some is left (n,): no less than at the base."""
    sensors = base.at.sensors
    explained = sensors.residual + sensors.computed - left
    moved = np.sqrt(np.bincount(sensors.groups, explained**2))[sensors.groups]
    return np.where(sensors.is_displacement, np.maximum(moved, base.nuisances.displacement), 0.0)
