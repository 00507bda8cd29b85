"""The linear model about a state of a fit: which coordinates are what, and their columns there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.errors import SolveError
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.dictionary import is_linear
from warpbrain.worlds.body.effects import Effect, Effects, column_slices, columns_over_time, width_of
from warpbrain.worlds.body.evidence import Sizes
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.mesh_error import MeshErrors
from warpbrain.worlds.body.nuisances import (
    FIELD,
    LAW,
    Nuisances,
    field_columns,
    law_columns,
    mesh_by_tissue,
    shared_parameter,
    tissue_columns,
)
from warpbrain.worlds.body.sensors import Sensors
from warpbrain.worlds.body.shapes import columns_of_other_shapes
from warpbrain.worlds.body.states import SolvedState, States
from warpbrain.worlds.body.weighted_set import MeshShare, Refit


@dataclass(frozen=True, eq=False)
class Layout:
    """Order of the coordinates of a fit: nuisances, causes that act linearly, coefficients of each effect."""

    #: Tissue, stiffness field, and the coefficients of all effects.
    tissue: slice
    field: slice
    coefficients: slice
    field_size: float  # of a coordinate of the field, relative to `States.modes`
    shapes: Ints  # of laws, and of mechanisms
    effects: tuple[slice, ...]  # coefficients of each effect
    linear: Bools  # (q + e,), which of the first act linearly: all but tissue and field
    nonlinear: Bools  # (q + e + k,), which act through an equilibrium
    #: Parameters of laws that effects have as coefficients: coordinate as a nuisance, as a coefficient, and
    #: `SharedParameter.ratio`.
    shared: tuple[tuple[int, int, float], ...]

    @property
    def field_of_nonlinear(self) -> Bools:
        """Which of the nonlinear coordinates are those of the stiffness field."""
        of_field = np.zeros(len(self.nonlinear), dtype=bool)
        of_field[self.field] = True
        return of_field[self.nonlinear]

    @classmethod
    def of(cls, nuisances: Nuisances, sizes: Sizes, count: int, effects: Sequence[Effect]) -> Layout:
        """With `count` coordinates before those of the effects, and a stiffness field of the size in `sizes`."""
        tissue, field = nuisances.part("tissue"), nuisances.part(FIELD)
        linear = np.ones(count, dtype=bool)
        linear[tissue] = linear[field] = False
        nonlinear = np.concatenate([~linear, np.ones(width_of(effects), dtype=bool)])
        law, parts = nuisances.part(LAW), column_slices(effects, count)
        parameters = ((shared_parameter(effect), part.start) for effect, part in zip(effects, parts, strict=True))
        shared = tuple((law.start + each.column, at, each.ratio) for each, at in parameters if each is not None)
        size, coefficients = float(nuisances.field_sizes.relative[sizes.field]), slice(count, None)
        return cls(tissue, field, coefficients, size, nuisances.shapes, parts, linear, nonlinear, shared)

    def without_shared(self, z: Floats) -> Floats:
        """The same tissue as coordinates (q + e + k,) with shared parameters in the coefficients of effects alone."""
        z = z.copy()
        for law, effect, ratio in self.shared:
            z[effect] += ratio * z[law]
            z[law] = 0.0
        return z


def columns_about(
    state: SolvedState,
    z: Floats,
    columns: Floats,
    layout: Layout,
    effects: Sequence[Effect],
    base: Base,
    mesh_errors: MeshErrors | None,
    mesh_share: MeshShare | None,
) -> tuple[Floats, Linearisation]:
    """Columns of tissue, field and mechanisms about a state; the others as they are.

    `z` (q,): its coordinates. `columns` (n, q): about another state. `mesh_share`: that is taken off the residuals.
    Returns columns (n, q), and the linear model. `SolveError` if the state is unstable or a mechanism not linear there.
    """
    at, columns = state.linearised(), columns.copy()
    tissue = tissue_columns(at, base.states, state.hypothesis.theta, base.prior)
    columns[:, layout.tissue] = tissue + mesh_by_tissue(state.sensors, mesh_errors)
    columns[:, layout.field] = layout.field_size * field_columns(at, base.states)
    made = Effects(at)
    first = layout.coefficients.start
    for effect, part in zip(effects, layout.effects, strict=True):
        c = effect.coefficients(z[part])
        if effect.columns_at is not None:
            columns[:, part] = effect.columns_at(c)
        elif effect.proposed.over_time is not None:
            columns[:, part] = columns_over_time(at, effect.proposed, c)
        elif not effect.proposed.is_there_or_not:
            there = {"mean": c} if effect.proposed.changes_in_time else {"follows": "smooth", "start": c}
            about = made.of([replace(effect.proposed, **there)], effect.proposed.make(c), columns_alone=True)[0]
            if not is_linear(about, at):
                raise SolveError(f"{effect.proposed.region or 'it'}: its effect is not linear here")
            columns[:, part] = about.columns
        else:
            continue
        if mesh_share is not None:
            columns[:, part] += mesh_share.columns(slice(part.start - first, part.stop - first))
    return columns, at


def with_shapes_about(fit: Refit, nuisances: Nuisances, sensors: Sensors, base: Base) -> Floats:
    """Columns (n, q) of nuisances over other sensors (n), those of the shape of laws and of mechanisms about a fit.

    With a stiffness field of the size that the fit has.
    """
    columns = nuisances.columns_with_field(fit.marginal.sizes.field)
    try:
        at = fit.state.linearised(sensors)
    except SolveError:
        return columns
    columns[:, nuisances.shapes] = shape_columns_about(at, fit.effects, fit.coefficients, base.states)
    return columns


def shape_columns_about(
    at: Linearisation,
    effects: Sequence[Effect],
    coefficients: Sequence[Floats],
    states: States,
) -> Floats:
    """Columns (n, k) of the shape of laws and of mechanisms about a state with effects that have these coefficients.

    What a law's does is next to nothing where strains are small: about the base, which nothing but declared loads
    deforms. It is not where a mechanism strains tissue by half, and would be taken for a cause. The column of a
    `SharedParameter` is zero.
    """
    columns = law_columns(Effects(at), states)
    columns[:, [each.column for each in map(shared_parameter, effects) if each is not None]] = 0.0
    return np.hstack([columns, columns_of_other_shapes(at, effects, coefficients)])
