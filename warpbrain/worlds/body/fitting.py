"""Fits of sets of causes without linearising: the best point of tissue, stiffness field and mechanisms together.

A fit is a few searches, each with laws, error of the mesh, noise and gross errors of the point that the one before came
to, until that changes nothing; as long as it does, searches are rough. Its evidence is Laplace's: that of the linear
model about the best point, summed over the scale of the noise and over gross errors as in screening.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.inference.beliefs import belief
from warpbrain.inference.causes import Cause, Place
from warpbrain.inference.subsets import Blocks
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import Effect, column_slices, width_of
from warpbrain.worlds.body.evidence import SetMarginal
from warpbrain.worlds.body.fit_search import ENOUGH, ROUGHLY, FitSearch
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.mesh_error import FinerStates
from warpbrain.worlds.body.states import SolvedState
from warpbrain.worlds.body.weighted_set import Refit

#: How often the sizes of effects are looked at anew, and by how much [nats] the linear model must say that others are
#: better: by more than a sum over a few sizes is larger than the largest of its terms.
_RESIZED, _BETTER = 4, 2.0
#: How often at most a search goes on with laws, error of the mesh, gross errors and noise of its result.
_ROUNDS = 8
#: After how many in succession it ends, too, that reach nothing better and leave no less: some go back and forth.
_WORSE = 2
#: Part of what these have changed of the log posterior density to which the next search is exact.
_PART = 0.1
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
        screened: SetMarginal,
        nearby: SolvedState | None = None,
        subset: Refit | None = None,
        wanted: float = -np.inf,
    ) -> Refit:
        """Fit one set; `SolveError` if there is no equilibrium near the start, nor on the way there.

        `columns` (n, q + e + k): of nuisances, of causes that act linearly (no physics, or what changes), and of
        effects, about the base or about `subset`. `starts`, each (q + e + k,): coordinates to begin at, of which the
        best are taken: the most probable ones about the base, and about the fit without any cause. Where points of a
        surface may belong to one side or the other there are several best points, and a fit with a mechanism must not
        miss the one that the fit without it has reached. `screened`: scale of the noise and gross errors of the set in
        the linear model. `nearby`: nearer to the start than the base. `subset`: a fit with the first of the effects, or
        with all of them, nearer still, whose share of the mesh's error is kept. `wanted`: a log evidence; a search that
        expects to reach less ends before it has converged.
        """
        search = FitSearch(self.base, self.mesh_errors, effects, columns, screened)
        if subset is not None:
            nearby = subset.state
            starts = [*starts, search.begin_at(subset)]
        nearby = nearby or self.base.state
        try:
            search.start(starts, nearby)
        except SolveError:
            search.start_toward(starts[0], nearby)
        if subset is None:
            search.backtrack_to_base()
        best = self._converged(search, wanted)
        for _ in range(_RESIZED):
            resized = self._resized(best)
            if resized is None:
                break
            best = resized
        return best

    def _resized(self, fit: Refit) -> Refit | None:
        """The fit with one effect at another of its sizes, if its log evidence is larger; None otherwise.

        A size is left out where the linear model expects no more of it than of one whose fit was no better.
        """
        # by effect, the gain that the linear model expected of a size whose fit was no better
        not_reached: dict[int, float] = {}
        for number, factor, gain in _better_sizes(fit):
            if gain < not_reached.get(number, -np.inf) + _BETTER:
                continue
            resized = self._continued(fit.scaled(number, factor), fit.log_evidence)
            if resized is not None and resized.log_evidence > fit.log_evidence:
                return resized
            not_reached[number] = gain
        return None

    def _continued(self, begun: Refit, wanted: float) -> Refit | None:
        """The fit that a search from a point comes to; None if it fails. `wanted`: see `fit`."""
        try:
            return self._converged(self._begun_at(begun, begun.effects), wanted)
        except CANNOT_BE_FITTED:
            return None

    def _begun_at(self, refit: Refit, effects: tuple[Effect, ...], about: Linearisation | None = None) -> FitSearch:
        """A search with effects at the coordinates of a fit; see `begin`."""
        search = FitSearch(self.base, self.mesh_errors, effects, refit.columns, refit.marginal)
        search.start([search.begin_at(refit, about)], refit.state)
        return search

    def _converged(self, search: FitSearch, wanted: float) -> Refit:
        """The fit that a search comes to, with effects of the sizes that they have; `wanted`: see `fit`."""
        enough, best, least, worse = ROUGHLY, None, np.inf, 0
        for number in range(_ROUNDS):
            search.minimise(ENOUGH if number == _ROUNDS - 1 else enough)
            fit = self._update(search)
            expected = search.expected_gain()
            gain = expected + search.left_of_shapes
            if enough == ENOUGH and gain < ENOUGH:
                best = fit
                break
            fit = replace(fit, unreached=gain, converged=False)
            # a search that ends where it began has the same evidence but for rounding, which must not tell how to go on
            better = best is None or fit.log_evidence > best.log_evidence + ENOUGH
            worse = 0 if better or gain < least - ENOUGH else worse + 1
            best, least = fit if better else best, min(gain, least)
            if worse == _WORSE or fit.marginal.log_evidence + belief("fits.trust") * gain < wanted:
                break
            enough = min(max(ENOUGH, _PART * expected), ROUGHLY)
        assert best is not None
        if not np.isfinite(best.log_evidence):
            raise FloatingPointError("its evidence is not a number")
        return best

    def begin(self, effects: tuple[Effect, ...], refit: Refit, about: Linearisation | None) -> Refit:
        """State, residual and Laplace evidence with other effects at the coordinates of a fit, before any iteration.

        `effects`: as many as those of the fit, with as many coefficients each. `refit`: whose columns, noise and share
        of the mesh's error are kept. `about`: of its state, if it was linearised. `SolveError` if there is no
        equilibrium.
        """
        return self._begun_at(refit, effects, about).result()

    def _update(self, search: FitSearch) -> Refit:
        """Take shapes, the error of the mesh, noise and gross errors of the best point of a search; return that.

        The error of the mesh without any cause is that of all fits to come. It depends on the tissue, not only in
        proportion, and would otherwise be taken for a mechanism's share.
        """
        search.update_shapes()
        if self.mesh_errors is not None and search.effects:
            search.update_mesh_share(self.mesh_errors, self.finer)
        elif self.mesh_errors is not None:
            self.mesh_errors = search.update_mesh_errors(self.mesh_errors, self.finer)
        fit = search.result()
        search.update_noise(fit)
        return fit


def _better_sizes(fit: Refit) -> list[tuple[int, float, float]]:
    """Other sizes of larger log evidence in the linear model about a fit, those nearest to the present ones first.

    Of each the number of the effect, the factor on its size, and the gain [nats].

    Which size is the most probable in the linear model about the base is no matter of the fit: there tissue is as
    soft as the base's, and what is far from linear needs more or less of a load. The prior of many coefficients
    would cost tens of nats.
    """
    better: list[tuple[int, float, float]] = []
    parts = column_slices(fit.effects, fit.columns.shape[1] - width_of(fit.effects))
    for number, (effect, part) in enumerate(zip(fit.effects, parts, strict=True)):
        factors = np.asarray(effect.sizes) / effect.size
        if len(factors) < 2:
            continue
        sized = np.delete(np.r_[part], list(effect.proposed.unscaled))
        others = fit.marginal.noise.of_noise(np.delete(fit.columns, sized, axis=1))
        cause = Cause("", (Place(fit.columns[:, sized]),), 0.0, factors)
        [logs] = Blocks(others, fit.linear, [cause]).log_factors()
        gains = logs - logs[np.argmin(np.abs(factors - 1.0))]
        better += [(number, *each) for each in zip(factors.tolist(), gains.tolist(), strict=True) if each[1] > _BETTER]
    return sorted(better, key=lambda each: abs(np.log(each[1])))
