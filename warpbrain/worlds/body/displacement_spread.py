"""How well the displacement of every node is known under a set of causes, to first order about its fit.

A coordinate `z` of the fit (of tissue, stiffness field, shape of the law, known loads, or a cause) moves the body by a
column of `J = du/dz`; with the covariance `C` of the coordinates after what was recorded,

    Var u = diag(J C J^T)

What moves recordings and not the body (registration), and the error of the mesh, have no column.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import Effect, width_of
from warpbrain.worlds.body.fit_columns import Layout, columns_about
from warpbrain.worlds.body.sensors import tracked_points
from warpbrain.worlds.body.weighted_set import WeightedSet

#: The family of what is not known of the case's loads.
_LOADS = "known loads"


def displacement_deviation(weighted_set: WeightedSet, base: Base) -> Floats:
    """Standard deviation (N, 3) [m] of each component of the displacement under a set: see the module.

    `weighted_set`: fitted, or without any cause. `SolveError` if a mechanism is not linear about the fit.
    """
    columns = displacement_columns(weighted_set, base)
    refit = weighted_set.refit
    if refit is None:
        covariance = weighted_set.marginal.model.coefficients(weighted_set.residual)[1]
    else:
        covariance = refit.marginal.model.coefficients(refit.linear)[1]
    # the model has columns of gross errors behind them
    of_coordinates = covariance[: columns.shape[1], : columns.shape[1]]
    variance = np.einsum("ij,jk,ik->i", columns, of_coordinates, columns, optimize=True)
    return np.sqrt(np.maximum(variance, 0.0)).reshape(-1, 3)


def displacement_columns(weighted_set: WeightedSet, base: Base) -> Floats:
    """Displacement (3 N, q + k) [m] of every node by a standard deviation of each coordinate of a fit.

    `SolveError`: as `displacement_deviation`.
    """
    refit = weighted_set.refit
    effects: tuple[Effect, ...] = ()
    if refit is None:
        state = base.state
        z = base.nuisances.coordinates(base.prior, state.hypothesis)
    else:
        state, effects = refit.state, refit.effects
        z = np.concatenate([refit.nuisances, *refit.coefficients])
    layout = Layout.of(base.nuisances, len(z) - width_of(effects), effects)
    mesh = state.system.model.mesh
    nodes = tracked_points(mesh, mesh.points, base.states.centre)
    nuisances, made = base.for_sensors(nodes)
    columns = np.zeros((len(nodes), len(z)))
    part, loads = base.nuisances.part(_LOADS), nuisances.part(_LOADS)
    # those that no recording sees have no coordinate
    if part.stop - part.start == loads.stop - loads.start:
        columns[:, part] = nuisances.columns[:, loads]
    # a switch is there: its size is not in question
    moving = [number for number, effect in enumerate(effects) if not effect.proposed.is_there_or_not]
    over_nodes = list(effects)
    for number, effect in zip(moving, made.of([effects[k].proposed for k in moving]), strict=True):
        over_nodes[number] = effect
        columns[:, layout.effects[number]] = effect.columns
    return columns_about(replace(state, sensors=nodes), z, columns, layout, over_nodes, base, None, None)[0]
