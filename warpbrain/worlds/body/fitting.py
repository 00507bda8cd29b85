"""Fits of sets of causes of one case without linearising: their starts, their noise, and the error of the mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.inference.marginal import Marginal
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.fit_search import FitSearch
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.mesh_error import FinerStates, MeshErrors
from warpbrain.worlds.body.refit import Refit, excess_error
from warpbrain.worlds.body.states import SolvedState

#: How often at most a fit is repeated with the error of the mesh, or the gross errors and the noise, of its result.
_ROUNDS = 3
#: Change of the log evidence below which the fit is not repeated again.
_SAME = 0.1
#: Change of the mesh's error [standard deviations of the noise, all sensors together] with which a fit is repeated.
_MATTERS = 0.3
#: What is raised of a set that cannot be fitted.
CANNOT_BE_FITTED = (SolveError, InputError, np.linalg.LinAlgError, FloatingPointError)


class Fitter:
    """Fits sets of causes of one case.

    `base`: where fits begin.
    """

    def __init__(self, base: Base) -> None:
        self.base = base
        self.mesh_errors = base.mesh_errors
        self.finer = FinerStates(base.states) if base.mesh_errors is None else base.mesh_errors.finer

    def fit(
        self,
        effects: tuple[Effect, ...],
        columns: Floats,
        starts: Sequence[Floats],
        screened: Marginal,
        nearby: SolvedState | None = None,
        subset: Refit | None = None,
    ) -> Refit:
        """Fit one set.

        Parameters
        ----------
        effects : tuple of Effect
        columns : (n, q + e + k) array
            Of nuisances, of causes that act linearly (unknown fields, or no physics), and of effects, about the base or
            about `subset`.
        starts : sequence of (q + e + k,) arrays
            Coordinates to begin at, of which the best are taken: the most probable ones about the base, and about the
            fit without any cause. Where points of a surface may belong to one side or the other there are several best
            points, and a fit with a mechanism must not miss the one that the fit without it has reached.
        screened : Marginal
            Scale of the noise and gross errors of the set in the linear model.
        nearby : SolvedState, optional
            Nearer to the start than the base.
        subset : Refit, optional
            A fit with the first of the effects, or with all of them, nearer still, whose share of the mesh's error is
            kept.

        Raises
        ------
        SolveError
            If there is no equilibrium near the start.
        """
        search = FitSearch(self.base, self.mesh_errors, effects, columns, screened)
        if subset is not None:
            nearby = subset.state
            starts = [*starts, search.begin_at(subset)]
        search.start(starts, nearby or self.base.state)
        if subset is None:
            search.backtrack_to_base()
        search.minimise()
        for _ in range(_ROUNDS):
            if self.mesh_errors is None or not self._mesh_error_changed(search, screened, self.mesh_errors):
                break
            search.minimise()
        fit = search.result()
        for _ in range(_ROUNDS):
            if not search.update_noise(fit):
                break
            search.minimise()
            before, fit = fit, search.result()
            if abs(fit.log_evidence - before.log_evidence) < _SAME:
                break
        if not np.isfinite(fit.log_evidence):
            raise FloatingPointError("its evidence is not a number")
        return fit

    def begin(self, effects: tuple[Effect, ...], refit: Refit, about: Linearisation | None) -> Refit:
        """State, residual and Laplace evidence with other effects at the coordinates of a fit, before any iteration.

        `effects`: as many as those of the fit, with as many coefficients each. `refit`: whose columns, noise and share
        of the mesh's error are kept. `about`: of its state, if it was linearised. `SolveError` if there is no
        equilibrium.
        """
        search = FitSearch(self.base, self.mesh_errors, effects, refit.columns, refit.marginal)
        search.start([search.begin_at(refit, about)], refit.state)
        return search.result()

    def _mesh_error_changed(self, search: FitSearch, screened: Marginal, known: MeshErrors) -> bool:
        """Compute the error of the mesh at the best point; whether the search has to go on with it."""
        if search.effects:
            return search.update_mesh_share(known, self.finer) or not search.converged
        if not self._update_mesh_errors(search.state, known, screened):
            return False
        search.mesh_errors = self.mesh_errors
        search.start([search.z], search.state)
        return True

    def _update_mesh_errors(self, state: SolvedState, known: MeshErrors, screened: Marginal) -> bool:
        """Take the error of the mesh from a fit without any cause, for all fits to come; whether it matters.

        It depends on the tissue, not only in proportion, and would otherwise be taken for a mechanism's share.
        """
        try:
            error = self.finer.error(state.hypothesis, state)
        except SolveError:
            return False
        change = excess_error(known, error, state, self.base.prior)
        self.mesh_errors = replace(known, error=error)
        return float(np.linalg.norm(screened.noise.whitened(change))) > _MATTERS
