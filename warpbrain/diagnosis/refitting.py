"""A hypothesis fitted without linearising it: tissue, stiffness field and mechanism together, then its evidence.

Gauss-Newton on standard normal coordinates: those of tissue, field and mechanism go through an equilibrium,
the other nuisances act linearly. The Jacobian is made anew where the mechanism acts. The evidence is Laplace's: that
of the linear model about the best point, averaged over the factor on the noise as in screening.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.discretisation import Difference
from warpbrain.estimation.gaussian import Gaussian
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.effects import Effect, Effects, parts_of
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.mesh_error import FinerStates, MeshErrors, expected, expected_answer
from warpbrain.worlds.body.nuisances import Nuisances, field_columns, mesh_by_tissue, tissue_columns
from warpbrain.worlds.body.states import Hypothesis, SolvedState, States

Floats = NDArray[np.float64]

_ITERATIONS, _HALVINGS = 6, 4
#: How far [standard deviations] coordinates go until columns are made anew.
_ANEW = 0.3
#: Change of the mesh's error [standard deviations of the noise, all sensors together] with which a fit goes on.
_MATTERS = 0.3
#: Step [standard deviations] of a difference between states.
_BESIDE = 0.05
#: Steps shorter than this in standard deviations of the prior end the search.
_SHORT = 0.03
#: How far [standard deviations] coordinates of tissue and field may go.
_FARTHEST = 3.0
#: Standard deviation of the mesh's error that belongs to a mechanism, as a part of what is corrected for. On meshes
#: that lock it is as large as the effect itself: far from where the power is known with which it falls.
_UNSURE = 0.5


@dataclass(frozen=True, eq=False)
class Refit:
    """A hypothesis at its best point.

    Attributes
    ----------
    effects : tuple of Effect
        Of the mechanisms that it has beside the case's own.
    state : SolvedState
    nuisances : (q,) array
        Their coordinates.
    coefficients : tuple of (k,) arrays
        Of each effect, in standard deviations about its mean.
    covariances : tuple of (k, k) arrays
        Of these.
    residual : (n,) array
        What is left at the best point, linear nuisances and expected mesh error taken off.
    linear : (n,) array
        Of the linear model about it, with all coordinates at zero.
    columns : (n, q + k) array
        Of that model.
    log_evidence : float
    kappa : float
        Factor on the noise.
    converged : bool
    """

    effects: tuple[Effect, ...]
    state: SolvedState
    nuisances: Floats
    coefficients: tuple[Floats, ...]
    covariances: tuple[Floats, ...]
    residual: Floats
    linear: Floats
    columns: Floats
    log_evidence: float
    kappa: float
    converged: bool

    def explanation(self, factor: Floats) -> Explanation:
        """The linear model about the best point."""
        return Explanation(factor, self.columns)

    @property
    def with_own_columns(self) -> tuple[Effect, ...]:
        """Its effects with the columns that they have at the best point."""
        found, at = [], len(self.nuisances)
        for effect in self.effects:
            size = effect.columns.shape[1]
            found.append(replace(effect, columns=self.columns[:, at : at + size]))
            at += size
        return tuple(found)


@dataclass(frozen=True, eq=False)
class _Share:
    """What of the mesh's error belongs to mechanisms: `answer (constant + along z)`.

    Attributes
    ----------
    answer : (n,) array
        At the sizes with which it was computed.
    along : (k,) array
        Over the coefficients of all mechanisms.
    constant : float
    """

    answer: Floats
    along: Floats
    constant: float


class Refitting:
    """Fits hypotheses of one case.

    Parameters
    ----------
    states : States
    prior : Gaussian
        Of the tissues' parameters.
    nuisances : Nuisances
        At the state that screening was done at.
    factor : (n, n) array
        Of the noise.
    start : SolvedState
        Near to the others.
    mesh_errors : MeshErrors or None
        There; None: meshes are taken for exact.
    """

    def __init__(
        self,
        states: States,
        prior: Gaussian,
        nuisances: Nuisances,
        factor: Floats,
        start: SolvedState,
        mesh_errors: MeshErrors | None,
    ) -> None:
        self.states, self.prior, self.nuisances, self.factor = states, prior, nuisances, factor
        self.start = start
        self._mesh = mesh_errors
        self._finer = FinerStates(states) if mesh_errors is None else mesh_errors.finer
        self._share: _Share | None = None
        self._between: Floats | None = None
        # of the last state of this fit that was followed over time
        self._course: tuple[Floats, ...] = ()
        self._U = nuisances.columns
        self._tissue, self._field = nuisances.part("tissue"), nuisances.part("stiffness field")
        self._linear = np.ones(self._U.shape[1], dtype=bool)
        self._linear[self._tissue] = self._linear[self._field] = False

    def fit(
        self,
        effects: tuple[Effect, ...],
        begins: Sequence[Floats],
        kappa: float = 1.0,
        near: SolvedState | None = None,
        between: Floats | None = None,
    ) -> Refit:
        """Fit one.

        Parameters
        ----------
        effects : tuple of Effect
            Columns at the state of screening.
        begins : sequence of (q + k,) arrays
            Coordinates that may be near: as screening has them, and as they are about the fit of nothing. Where points
            of a surface may belong to one side or the other there are several best points, and a fit with a mechanism
            must not be kept from the one that the fit without it has found.
        kappa : float
        near : SolvedState, optional
            Nearer to the beginning than the state of screening.
        between : (n, k) array, optional
            What is not known of the last effect between neighbours of its scan, one standard deviation each.

        Raises
        ------
        SolveError
            If there is no equilibrium near the beginning.
        """
        self._share, self._between, self._course = None, between, ()
        columns = np.concatenate([self._U, *(effect.columns for effect in effects)], axis=1)
        found = self._descend(effects, begins, columns, kappa, near or self.start, True)
        if self._mesh is None:
            return self._refit(effects, *found)
        state, z, _, columns, converged = found
        if not effects:
            if self._settle(state, self._mesh):
                found = self._descend(effects, [z], columns, kappa, state, False)
            return self._refit(effects, *found)
        self._share = self._share_of(effects, state, z)
        if self._share is None and converged:
            return self._refit(effects, *found)
        if self._share is not None:
            columns = columns.copy()
            own = slice(self._U.shape[1], self._U.shape[1] + len(self._share.along))
            columns[:, own] += np.outer(self._share.answer, self._share.along)
        return self._refit(effects, *self._descend(effects, [z], columns, kappa, state, False))

    @property
    def mesh_errors(self) -> MeshErrors | None:
        """Of the fit of nothing, where that was fitted; else those that were given."""
        return self._mesh

    def _best_of(
        self, effects: tuple[Effect, ...], begins: Sequence[Floats], kappa: float, near: SolvedState
    ) -> tuple[SolvedState, Floats, Floats]:
        """State, residual and coordinates of the best of some coordinates, within limits."""
        found = []
        for begin in begins:
            z = self._limited(begin)
            try:
                found.append((*self._try(effects, z, near), z))
            except (SolveError, InputError):
                if not found and begin is begins[-1]:
                    raise
        return min(found, key=lambda one: self._objective(one[1], one[2], kappa))

    def _settle(self, state: SolvedState, before: MeshErrors) -> bool:
        """Take the error of the mesh from a fit of nothing, for all fits to come; whether that matters.

        It depends on the tissue, not only in proportion, and would be taken for a mechanism's share otherwise.
        """
        try:
            error = self._finer.error(state.hypothesis, state)
        except SolveError:
            return False
        change = self._beyond(before, error, state)
        self._mesh = replace(before, own=error)
        return float(np.linalg.norm(self._whitened(change))) > _MATTERS

    def _beyond(self, known: MeshErrors, error: Difference, state: SolvedState) -> Floats:
        """What an error of the mesh is beyond that which its tissue alone is known to have, in what is recorded."""
        return expected_answer(state.sensors, error.less(known.of(state.hypothesis, self.prior)))

    def _share_of(self, effects: tuple[Effect, ...], state: SolvedState, z: Floats) -> _Share | None:
        """What of the mesh's error belongs to the mechanisms, in proportion to their sizes; None if not known.

        What is there or not has no size: alone it has a constant share, beside others none.
        """
        assert self._mesh is not None
        away, middle, at = [], [], self._U.shape[1]
        for effect in effects:
            size = effect.columns.shape[1]
            has_size = not effect.proposed.is_there_or_not
            # along what it is: its coefficients, each in standard deviations
            away.append(has_size * effect.away(z[at : at + size]))
            middle.append(has_size * effect.away(np.zeros(size)))
            at += size
        scaled, mean = np.concatenate(away), np.concatenate(middle)
        length = float(scaled @ scaled)
        switches = all(effect.proposed.is_there_or_not for effect in effects)
        # of what changes in time the finer mesh says nothing: it is computed in the end state alone
        changing = any(effect.proposed.changes_in_time for effect in effects)
        if (length < 1e-6 and not switches) or changing:
            return None
        try:
            error = self._finer.error(state.hypothesis, state)
        except SolveError:
            return None
        answer = self._beyond(self._mesh, error, state)
        along = np.zeros(len(scaled)) if switches else scaled / length
        return _Share(answer, along, 1.0 if switches else float(along @ mean))

    def _descend(
        self,
        effects: tuple[Effect, ...],
        begins: Sequence[Floats],
        columns: Floats,
        kappa: float,
        near: SolvedState,
        anew: bool,
    ) -> tuple[SolvedState, Floats, Floats, Floats, bool]:
        """State, coordinates, residual, columns and whether it converged; `anew`: whether columns are made anew."""
        q = self._U.shape[1]
        state, residual, z = self._best_of(effects, begins, kappa, near)
        best = self._objective(residual, z, kappa)
        # far from the base the linear model may have gone too far
        base = self._at_base(z)
        for part in (0.5, 0.0) if anew else ():
            between = base + part * (z - base)
            beside, left = self._try(effects, between, near)
            value = self._objective(left, between, kappa)
            if value >= best:
                break
            state, residual, z, best = beside, left, between, value
        converged, made_at, solved = False, np.full(len(z), np.inf), False
        moving = ~np.concatenate([self._linear, np.zeros(len(z) - q, dtype=bool)])
        for iteration in range(_ITERATIONS):
            if anew and iteration > 0 and np.abs(z - made_at)[moving].max(initial=0.0) > _ANEW:
                columns, made_at = self._columns_at(state, effects, z[q:], columns), z
                if solved:
                    columns = self._columns_solved(state, residual, effects, z, columns)
            white = self._whitened(np.column_stack([residual, columns])) / kappa
            gradient = white[:, 1:].T @ white[:, 0] - z
            step = np.linalg.solve(np.eye(len(z)) + white[:, 1:].T @ white[:, 1:], gradient)
            taken = False
            for _ in range(_HALVINGS):
                trial = self._limited(z + step)
                try:
                    beside, left = self._try(effects, trial, state)
                except (SolveError, InputError):
                    step = 0.5 * step
                    continue
                value = self._objective(left, trial, kappa)
                if value <= best + 1e-9:
                    converged = bool(np.abs(trial - z).max() < _SHORT)
                    state, residual, z, best, taken = beside, left, trial, value, True
                    break
                step = 0.5 * step
            if not taken:
                # what is left is rounding, or nothing better lies this way: the last good point stands
                converged = bool(np.abs(step).max() < 2.0 * _SHORT)
                if converged or solved or not anew or not any(effect.proposed.history for effect in effects):
                    break
                # tissue that is several times as stiff at first is no small change of what it is in the end
                solved, made_at = True, np.full(len(z), np.inf)
            if converged:
                break
        return state, z, residual, columns, converged

    def _at_base(self, z: Floats) -> Floats:
        """The same coordinates, but with tissue and field of the base."""
        found = z.copy()
        known = self.nuisances.coordinates(self.prior, self.start.hypothesis)
        for part in (self._tissue, self._field):
            found[part] = known[part]
        return found

    def _limited(self, z: Floats) -> Floats:
        found = z.copy()
        for part in (self._tissue, self._field):
            found[part] = np.clip(found[part], -_FARTHEST, _FARTHEST)
        return found

    def _objective(self, residual: Floats, z: Floats, kappa: float) -> float:
        white = self._whitened(residual) / kappa
        return 0.5 * float(white @ white + z @ z)

    def _whitened(self, rows: Floats) -> Floats:
        """`L^-1` of rows (n, ...)."""
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self.factor, rows, lower=True, check_finite=False))

    def _hypothesis(self, effects: tuple[Effect, ...], z: Floats) -> Hypothesis:
        mechanisms, patches, at = [], [], self._U.shape[1]
        for effect in effects:
            size = effect.columns.shape[1]
            mechanisms.append(effect.proposed.make(effect.coefficients(z[at : at + size])))
            if effect.proposed.patch is not None:
                patches.append(effect.proposed.patch)
            at += size
        theta = self.prior.mean + self.prior.factor @ z[self._tissue]
        return Hypothesis(theta, z[self._field], tuple(mechanisms), tuple(patches))

    def _try(
        self, effects: tuple[Effect, ...], z: Floats, near: SolvedState | None = None
    ) -> tuple[SolvedState, Floats]:
        hypothesis = self._hypothesis(effects, z)
        begin = self.start if near is None else near
        error = None if self._mesh is None else expected(self._mesh.of(hypothesis, self.prior))
        try:
            state = self.states.solve(hypothesis, begin.u, error, begin.course or self._course)
        except SolveError:
            state = self.states.solve(hypothesis, None, error)
        self._course = state.course or self._course
        at = self._U.shape[1]
        linear = self._U[:, self._linear] @ z[:at][self._linear]
        residual = state.sensors.residual - linear
        if self._share is not None:
            own = z[at : at + len(self._share.along)]
            residual = residual - self._share.answer * (self._share.constant + float(self._share.along @ own))
        for effect in effects:
            size = effect.columns.shape[1]
            if effect.proposed.is_there_or_not:
                # it is there or not: its share only says how exactly it is simulated
                residual = residual - effect.columns @ z[at : at + size]
            at += size
        return state, residual

    def _columns_solved(
        self, state: SolvedState, residual: Floats, effects: tuple[Effect, ...], z: Floats, columns: Floats
    ) -> Floats:
        """Columns with those of tissue and mechanisms from states that are solved beside this one."""
        columns = columns.copy()
        numbers = np.arange(len(z))
        for k in (*numbers[self._tissue].tolist(), *numbers[self._U.shape[1] :].tolist()):
            beside = z + _BESIDE * np.eye(1, len(z), k)[0]
            try:
                columns[:, k] = (residual - self._try(effects, beside, state)[1]) / _BESIDE
            except (SolveError, InputError):
                continue
        return columns

    def _columns_at(self, state: SolvedState, effects: tuple[Effect, ...], z: Floats, columns: Floats) -> Floats:
        """Columns with those of tissue, field and mechanisms made anew where they are now."""
        q = self._U.shape[1]
        columns = columns.copy()
        if any(effect.about is not None for effect in effects):
            # what was solved over time has no one state to be linear about
            at = None
        else:
            try:
                at = Linearisation(state.system, state.u, state.reactions, state.sensors)
            except SolveError:
                return columns
            early = self._early(state, effects, z)
            tissue = early * tissue_columns(at, self.states, state.hypothesis.theta, self.prior)
            columns[:, self._tissue] = tissue + mesh_by_tissue(state.sensors, self._mesh)
            columns[:, self._field] = early * field_columns(at, self.states)
        place = 0
        for effect in effects:
            size = effect.columns.shape[1]
            own = slice(q + place, q + place + size)
            here = effect.coefficients(z[place : place + size])
            if effect.about is not None:
                columns[:, own] = effect.about(here)
            elif at is not None and not effect.proposed.is_there_or_not:
                made = Effects(at, mesh_errors=self._mesh)
                columns[:, own] = made.of([_about(effect.proposed, here)], effect.proposed.make(here))[0].columns
            place += size
        return columns

    @staticmethod
    def _early(state: SolvedState, effects: tuple[Effect, ...], z: Floats) -> Floats:
        """How many times what tissue does in the end (n, 1) it does where it has not relaxed."""
        stiffer, place = np.ones(len(state.sensors)), 0
        for effect in effects:
            size = effect.columns.shape[1]
            if effect.proposed.history is not None:
                here = effect.coefficients(z[place : place + size])
                stiffer += np.maximum(parts_of(effect.proposed, here, state.sensors), 0.0)
            place += size
        return np.where(state.sensors.is_displacement, 1.0 / stiffer, stiffer)[:, None]

    def _refit(
        self,
        effects: tuple[Effect, ...],
        state: SolvedState,
        z: Floats,
        residual: Floats,
        columns: Floats,
        converged: bool,
    ) -> Refit:
        q = self._U.shape[1]
        linear = residual + columns @ z
        model = Explanation(self.factor, columns)
        white = model.whitened(linear)
        log_evidence = float(model.log_marginal(white[:, None])[0])
        kappa = model.best_kappa(white)
        # of the size of the mechanism these say something, of its evidence nothing
        W = model.whitened(np.column_stack([columns, *self._unsure(z[q:])])) / kappa
        covariance = np.asarray(np.linalg.inv(np.eye(W.shape[1]) + W.T @ W), dtype=np.float64)
        # where the amount would go with them, or had the search not ended, is not where it is said to be
        away = (covariance @ (W.T @ white) / kappa)[: len(z)] - z
        coefficients: list[Floats] = []
        covariances: list[Floats] = []
        at = q
        for effect in effects:
            size = effect.columns.shape[1]
            coefficients.append(z[at : at + size])
            own = slice(at, at + size)
            covariances.append(covariance[own, own] + np.outer(away[own], away[own]))
            at += size
        return Refit(
            effects,
            state,
            z[:q],
            tuple(coefficients),
            tuple(covariances),
            residual,
            linear,
            columns,
            log_evidence,
            kappa,
            converged,
        )

    def _unsure(self, z: Floats) -> list[Floats]:
        """Columns (n, k) of what is not known of a mechanism beside its coefficients: the mesh's share, the scan."""
        found = [] if self._between is None else [self._between]
        if self._share is not None:
            size = self._share.constant + float(self._share.along @ z[: len(self._share.along)])
            found.append(_UNSURE * size * self._share.answer[:, None])
        return found


def _about(proposal: Proposal, here: Floats) -> Proposal:
    """The proposal from which the columns about some coefficients (k,) follow."""
    if proposal.changes_in_time:
        return replace(proposal, mean=here)
    return replace(proposal, follows="smooth", start=here)
