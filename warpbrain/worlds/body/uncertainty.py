"""How well tissue and displacement are known, with all that may act on a body.

Tissue is averaged over the sets of causes. With the probability `P(S)` of each set S, and mean `m_S` and covariance
`C_S` of the tissue in the linear model with S,

    p(theta) = sum P(S) N(theta; m_S, C_S),  m = sum P(S) m_S,  C = sum P(S) (C_S + (m_S - m) (m_S - m)^T)

The displacement of every node is known under one set, to first order about its fit. A coordinate `z` of the fit (of
tissue, stiffness field, shape of the law, known loads, or a cause) moves the body by a column of `J = du/dz`; with the
covariance `C` of the coordinates after what was recorded,

    Var u = diag(J C J^T)

What moves recordings and not the body (registration), and the error of the mesh, have no column.
"""

from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.estimation.parameters import Parameters
from warpbrain.inference.causes import Kind
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.boundaries import boundary_columns
from warpbrain.worlds.body.effects import Effect, width_of
from warpbrain.worlds.body.fit_columns import Layout, columns_about, shape_columns_about
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.nuisances import BOUNDARIES, LOADS, load_columns
from warpbrain.worlds.body.sensors import tracked_points
from warpbrain.worlds.body.weighted_set import WeightedSet


@dataclass(frozen=True)
class LikelyCause:
    """Something that may act, and the probability that it does, whatever else acts."""

    name: str
    kind: Kind
    probability: float


@dataclass(frozen=True, eq=False)
class AveragedTissue:
    """A mixture of normal distributions of `theta`, one for each set of causes."""

    parameters: Parameters  # what `theta` means
    nothing: float  # probability that nothing acts but what the case says
    causes: tuple[LikelyCause, ...]  # the most probable first
    probabilities: Floats  # (s,), of the sets
    means: Floats  # (s, p)
    covariances: Floats  # (s, p, p)

    @property
    def mean(self) -> Floats:
        """Of `theta`, shape (p,)."""
        return self.probabilities @ self.means

    @property
    def covariance(self) -> Floats:
        """Of `theta`, shape (p, p)."""
        deviations = self.means - self.mean
        covariances = self.covariances + deviations[:, :, None] * deviations[:, None, :]
        return np.asarray(np.tensordot(self.probabilities, covariances, 1))

    def interval(self, probability: float) -> Floats:
        """Ends (p, 2) between which a parameter is with a probability, as much below as above."""
        from scipy.optimize import brentq
        from scipy.special import ndtr, ndtri

        tails = 0.5 * (1.0 - probability), 0.5 * (1.0 + probability)
        intervals = np.empty((len(self.mean), 2))
        for k, ends in enumerate(intervals):
            means, deviations = self.means[:, k], np.sqrt(self.covariances[:, k, k])
            for side, tail in enumerate(tails):
                # a quantile of a mixture is between those of its parts
                parts = means + ndtri(tail) * deviations
                low, high = parts.min() - deviations.max(), parts.max() + deviations.max()
                ends[side] = brentq(
                    lambda x, m=means, s=deviations, q=tail: self.probabilities @ ndtr((x - m) / s) - q, low, high
                )
        return intervals


def averaged_tissue(search: HypothesisSearch) -> AveragedTissue:
    """Tissue averaged over the sets of a search that were weighed."""
    base, weighted_sets, probabilities = search.base, search.weighted_sets, search.probabilities
    tissue, prior = base.nuisances.part("tissue"), base.prior
    means, covariances = [], []
    causes: dict[tuple[str, Kind], float] = {}
    for weighted_set, probability in zip(weighted_sets, probabilities.tolist(), strict=True):
        xi, covariance = weighted_set.marginal.model.coefficients(weighted_set.residual)
        means.append(prior.mean + prior.factor @ xi[tissue])
        covariances.append(prior.factor @ covariance[tissue, tissue] @ prior.factor.T)
        for cause in zip(weighted_set.hypothesis.causes, weighted_set.hypothesis.kinds, strict=True):
            causes[cause] = causes.get(cause, 0.0) + probability
    likely = sorted(causes.items(), key=lambda item: -item[1])
    return AveragedTissue(
        base.states.parameters,
        sum(p for s, p in zip(weighted_sets, probabilities.tolist(), strict=True) if not s.names),
        tuple(LikelyCause(name, kind, probability) for (name, kind), probability in likely),
        probabilities,
        np.array(means),
        np.array(covariances),
    )


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
    layout = Layout.of(base.nuisances, weighted_set.marginal.sizes, len(z) - width_of(effects), effects)
    mesh = state.system.model.mesh
    nodes = tracked_points(mesh, mesh.points, base.states.centre)
    over = base.at.with_sensors(nodes)
    columns, made = np.zeros((len(nodes), len(z))), base.effects.over(over)
    part, loads = base.nuisances.part(LOADS), load_columns(over)
    # those that no recording sees have no coordinate
    if part.stop - part.start == loads.shape[1]:
        columns[:, part] = loads
    columns[:, base.nuisances.part(BOUNDARIES)] = boundary_columns(over) @ base.nuisances.boundary_modes
    # a switch is there: its size is not in question
    moving = [number for number, effect in enumerate(effects) if not effect.proposed.is_there_or_not]
    over_nodes = list(effects)
    for number, effect in zip(moving, made.of([effects[k].proposed for k in moving]), strict=True):
        over_nodes[number] = effect
        columns[:, layout.effects[number]] = effect.columns
    columns, at = columns_about(replace(state, sensors=nodes), z, columns, layout, over_nodes, base, None, None)
    coefficients = [z[part] for part in layout.effects]
    columns[:, layout.shapes] = shape_columns_about(at, over_nodes, coefficients, base.states)
    return columns
