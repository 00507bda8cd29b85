"""A hypothesis fitted without linearising it: tissue, stiffness field and mechanisms together, then its evidence.

Gauss-Newton on standard normal coordinates: those of tissue, field and mechanisms go through an equilibrium,
the other nuisances act linearly. The Jacobian is made anew where the mechanisms act. The evidence is Laplace's: that
of the linear model about the best point, summed over the scale of the noise and over gross errors as in screening.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.discretisation import Difference
from warpbrain.inference.beliefs import belief
from warpbrain.inference.marginal import Marginal, marginal
from warpbrain.physics.proposal import Proposal
from warpbrain.simulation.extrapolated import extrapolated
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import Effect, Effects, parts_of
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.mesh_error import ENOUGH, FinerStates, MeshErrors, expected, expected_answer
from warpbrain.worlds.body.nuisances import field_columns, mesh_by_tissue, registration_sd, tissue_columns
from warpbrain.worlds.body.states import Hypothesis, SolvedState

Floats = NDArray[np.float64]

_ITERATIONS, _HALVINGS = 20, 6
#: How often at most a fit goes on with gross errors and noise as it has found them itself.
_ROUNDS = 3
#: Change of the log evidence below which that is no other fit.
_SAME = 0.1
#: How far [standard deviations] coordinates go until columns are made anew.
_ANEW = 0.3
#: Change of the mesh's error [standard deviations of the noise, all sensors together] with which a fit goes on.
_MATTERS = 0.3
#: Step [standard deviations] of a difference between states.
_BESIDE = 0.05
#: States beside the last one from which the next is begun at most.
_KEPT = 9
#: Steps shorter than this in standard deviations of the prior end the search.
_SHORT = 0.03


@dataclass(frozen=True, eq=False)
class Refit:
    """A hypothesis at its best point.

    Attributes
    ----------
    effects : tuple of Effect
        Of the mechanisms that it has beside the case's own.
    state : SolvedState
    nuisances : (q,) array
        Their coordinates, and those of causes that act linearly.
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
    marginal : Marginal
        Its evidence, the scale of the noise and gross errors.
    converged : bool
    share : Share or None
        Of its mechanisms in the mesh's error, if that is known.
    """

    effects: tuple[Effect, ...]
    state: SolvedState
    nuisances: Floats
    coefficients: tuple[Floats, ...]
    covariances: tuple[Floats, ...]
    residual: Floats
    linear: Floats
    columns: Floats
    marginal: Marginal
    converged: bool
    share: Share | None = None

    @property
    def log_evidence(self) -> float:
        """Laplace's."""
        return self.marginal.log_evidence


@dataclass(frozen=True, eq=False)
class Share:
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

    def at(self, z: Floats) -> Floats:
        """Of coefficients (k,): (n,)."""
        return self.answer * (self.constant + float(self.along @ z))

    def among(self, count: int) -> Share:
        """The same beside further mechanisms, `count` coefficients in all."""
        return replace(self, along=np.append(self.along, np.zeros(count - len(self.along))))


class Refitting:
    """Fits hypotheses of one case.

    Parameters
    ----------
    base : Base
        Where they begin.
    """

    def __init__(self, base: Base) -> None:
        self.base = base
        self.mesh_errors = base.mesh_errors
        self.finer = FinerStates(base.states) if base.mesh_errors is None else base.mesh_errors.finer

    def fit(
        self,
        effects: tuple[Effect, ...],
        extra: Floats,
        begins: Sequence[Floats],
        within: Marginal,
        near: SolvedState | None = None,
        smaller: tuple[Refit, Floats] | None = None,
    ) -> Refit:
        """Fit one.

        Parameters
        ----------
        effects : tuple of Effect
            Columns at the state of screening.
        extra : (n, e) array
            Columns of causes that act linearly: without a name, or no physics.
        begins : sequence of (q + e + k,) arrays
            Coordinates that may be near: as screening has them, and as they are about the fit of nothing. Where points
            of a surface may belong to one side or the other there are several best points, and a fit with a mechanism
            must not be kept from the one that the fit without it has found.
        within : Marginal
            Scale of the noise and gross errors of the hypothesis.
        near : SolvedState, optional
            Nearer to the beginning than the base.
        smaller : (Refit, (n, q + e + k) array), optional
            The fit with the first of the effects alone: nearer still, and with the error of the mesh as it has it; and
            columns of all about it.

        Raises
        ------
        SolveError
            If there is no equilibrium near the beginning.
        """
        search = _Search(self, effects, extra, within)
        if smaller is not None:
            near = smaller[0].state
            begins = [*begins, search.begin_about(*smaller)]
        search.begin(begins, near or self.base.state)
        if smaller is None:
            search.draw_back()
        search.descend(anew=True)
        if self.mesh_errors is not None:
            if not effects:
                if self._settle(search.state, self.mesh_errors, within):
                    search.begin([search.z], search.state)
                    search.descend(anew=False)
            elif search.take_share() or not search.converged:
                search.begin([search.z], search.state)
                search.descend(anew=False)
        fit = search.result()
        for _ in range(_ROUNDS):
            if not search.take_noise(fit.marginal):
                break
            search.descend(anew=True)
            before, fit = fit, search.result()
            if abs(fit.log_evidence - before.log_evidence) < _SAME:
                break
        return fit

    def _settle(self, state: SolvedState, before: MeshErrors, within: Marginal) -> bool:
        """Take the error of the mesh from a fit of nothing, for all fits to come; whether that matters.

        It depends on the tissue, not only in proportion, and would be taken for a mechanism's share otherwise.
        """
        try:
            error = self.finer.error(state.hypothesis, state)
        except SolveError:
            return False
        change = self.beyond(before, error, state)
        self.mesh_errors = replace(before, own=error)
        return float(np.linalg.norm(within.noise.whitened(change))) > _MATTERS

    def beyond(self, known: MeshErrors, error: Difference, state: SolvedState) -> Floats:
        """What an error of the mesh is beyond that which its tissue alone is known to have, in what is recorded."""
        return expected_answer(state.sensors, error.less(known.of(state.hypothesis, self.base.prior)))


class _Search:
    """One fit on its way: the best point so far, and the columns of the linear model about it."""

    def __init__(self, fits: Refitting, effects: tuple[Effect, ...], extra: Floats, within: Marginal) -> None:
        self._fits, self._base, self._effects = fits, fits.base, effects
        self._within, self._noise, self._scale = within, within.noise, within.scale
        nuisances = fits.base.nuisances
        self._U = np.column_stack([nuisances.columns, extra])
        self._tissue, self._field = nuisances.part("tissue"), nuisances.part("stiffness field")
        self._linear = np.ones(self._U.shape[1], dtype=bool)
        self._linear[self._tissue] = self._linear[self._field] = False
        # recordings are taken back by a motion already, which costs what it costs in coordinates
        self._aligned = np.zeros(self._U.shape[1])
        self._aligned[nuisances.part("registration")] = fits.base.states.motion / registration_sd()
        self._own = _slices(effects, self._U.shape[1])
        self._moving = np.ones(self._U.shape[1] + sum(effect.columns.shape[1] for effect in effects), dtype=bool)
        self._moving[: len(self._linear)] = ~self._linear
        # coordinates that move the body, of states of this fit, and where it was
        self._known: list[tuple[Floats, Floats]] = []
        self._share: Share | None = None
        # where what is linear was factorised last
        self._at = fits.base.at
        # where columns were made
        self._made_at = np.full(len(self._moving), np.inf)
        # of the last state of this fit that was followed over time
        self._course: tuple[Floats, ...] = ()
        self.columns = np.concatenate([self._U, *(effect.columns for effect in effects)], axis=1)
        self.state, self.converged = fits.base.state, False
        self.z, self.residual, self._best = np.zeros(self.columns.shape[1]), np.zeros(len(self._U)), np.inf

    def begin(self, begins: Sequence[Floats], near: SolvedState) -> None:
        """Take the best of some coordinates, within limits."""
        self._best = np.inf
        for begin in begins:
            z = self._limited(begin)
            try:
                self._take_if_better(z, *self._try(z, near))
            except (SolveError, InputError):
                if begin is begins[-1] and not np.isfinite(self._best):
                    raise

    def descend(self, anew: bool) -> None:
        """Go to the best point near; `anew`: whether columns are made anew."""
        self.converged, solved = False, False
        for iteration in range(_ITERATIONS):
            if anew and iteration > 0 and np.abs(self.z - self._made_at)[self._moving].max(initial=0.0) > _ANEW:
                self.columns, self._made_at = self._columns_here(), self.z
                if solved:
                    self.columns = self._columns_solved()
            step, here = self._step(), np.array_equal(self._made_at, self.z)
            if not self._stepped(step):
                if anew and not here and np.abs(step).max() >= 2.0 * _SHORT:
                    # columns made elsewhere point elsewhere
                    self._made_at = np.full(len(self.z), np.inf)
                    continue
                # what is left is rounding, or nothing better lies this way: the last good point stands
                self.converged = bool(np.abs(step).max() < 2.0 * _SHORT)
                if self.converged or solved or not anew or not any(one.proposed.history for one in self._effects):
                    return
                # tissue that is several times as stiff at first is no small change of what it is in the end
                solved, self._made_at = True, np.full(len(self.z), np.inf)
            if self.converged:
                return

    def draw_back(self) -> None:
        """Toward the base where that is better: far from it the linear model may have gone too far."""
        base = self.z.copy()
        known = self._base.nuisances.coordinates(self._base.prior, self._base.state.hypothesis)
        for part in (self._tissue, self._field):
            base[part] = known[part]
        far = self.z
        for share in (0.5, 0.0):
            between = base + share * (far - base)
            if not self._take_if_better(between, *self._try(between, self.state)):
                return

    def _step(self) -> Floats:
        white = self._noise.whitened(np.column_stack([self.residual, self.columns]))
        gradient = white[:, 1:].T @ white[:, 0] - self.z
        return np.asarray(np.linalg.solve(np.eye(len(self.z)) + white[:, 1:].T @ white[:, 1:], gradient))

    def _stepped(self, step: Floats) -> bool:
        """Go along a step, halved until it is downhill; whether any of it was."""
        for _ in range(_HALVINGS):
            before, trial = self.z, self._limited(self.z + step)
            try:
                better = self._take_if_better(trial, *self._try(trial, self.state))
            except (SolveError, InputError):
                better = False
            if better:
                self.converged = bool(np.abs(trial - before).max() < _SHORT)
                return True
            step = 0.5 * step
        return False

    def _take_if_better(self, z: Floats, state: SolvedState, residual: Floats) -> bool:
        white = self._noise.whitened(residual)
        value = 0.5 * float(white @ white + z @ z)
        if not value <= self._best + 1e-9:
            return False
        self.z, self.state, self.residual, self._best = z, state, residual, value
        return True

    def _limited(self, z: Floats) -> Floats:
        limited, farthest = z.copy(), belief("tissue.farthest")
        for part in (self._tissue, self._field):
            limited[part] = np.clip(limited[part], -farthest, farthest)
        return limited

    def _try(self, z: Floats, near: SolvedState) -> tuple[SolvedState, Floats]:
        """State and residual at coordinates."""
        base, mesh = self._base, self._fits.mesh_errors
        mechanisms, patches = [], []
        for effect, own in zip(self._effects, self._own, strict=True):
            mechanisms.append(effect.proposed.make(effect.coefficients(z[own])))
            if effect.proposed.patch is not None:
                patches.append(effect.proposed.patch)
        theta = base.prior.mean + base.prior.factor @ z[self._tissue]
        hypothesis = Hypothesis(theta, z[self._field], tuple(mechanisms), tuple(patches))
        error = None if mesh is None else expected(mesh.of(hypothesis, base.prior))
        state = self._solved(hypothesis, z[self._moving], near, error)
        self._course = state.course or self._course
        q = self._U.shape[1]
        residual = state.sensors.residual - self._U[:, self._linear] @ (z[:q] - self._aligned)[self._linear]
        if self._share is not None:
            residual = residual - self._share.at(z[q:])
        for effect, own in zip(self._effects, self._own, strict=True):
            if effect.proposed.is_there_or_not:
                # it is there or not: its share only says how exactly it is simulated
                residual = residual - effect.columns @ z[own]
        return state, residual

    def take_noise(self, found: Marginal) -> bool:
        """Go on with the noise and the gross errors of a fit where these are others than it was made with."""
        same = found.scale == self._within.scale and np.array_equal(found.gross, self._within.gross)
        self._within, self._noise, self._scale = found, found.noise, found.scale
        if not same:
            self._best = np.inf
            self._take_if_better(self.z, self.state, self.residual)
        return not same

    def _solved(self, hypothesis: Hypothesis, z: Floats, near: SolvedState, error: Difference | None) -> SolvedState:
        """The state at coordinates that move the body, from those that are known."""
        states = self._base.states
        begin = extrapolated(self._known, z) if self._known else near.u
        try:
            state = states.solve(hypothesis, begin, error, near.course or self._course, nearby=self._at)
        except SolveError:
            state = states.solve(hypothesis, None, error)
        self._known = [*self._known[-_KEPT:], (z, state.u)]
        return state

    def take_share(self) -> bool:
        """Find what of the mesh's error belongs to the mechanisms, in proportion to their sizes; whether it is known.

        What is there or not has no size: alone it has a constant share, beside others none.
        """
        effects, known = self._effects, self._fits.mesh_errors
        assert known is not None
        sized = [not effect.proposed.is_there_or_not for effect in effects]
        each = list(zip(sized, effects, self._own, strict=True))
        scaled = np.concatenate([has * effect.away(self.z[own]) for has, effect, own in each])
        mean = np.concatenate([has * effect.away(np.zeros(own.stop - own.start)) for has, effect, own in each])
        length = float(scaled @ scaled)
        # of what changes in time the finer mesh says nothing: it is computed in the end state alone
        changing = any(effect.proposed.changes_in_time for effect in effects)
        if (length < 1e-6 and any(sized)) or changing:
            return False
        try:
            error = self._fits.finer.error(self.state.hypothesis, self.state, ENOUGH)
        except SolveError:
            return False
        answer = self._fits.beyond(known, error, self.state)
        along = scaled / length if any(sized) else np.zeros(len(scaled))
        self._know(Share(answer, along, float(along @ mean) if any(sized) else 1.0))
        return True

    def begin_about(self, smaller: Refit, columns: Floats) -> Floats:
        """Take columns about a fit with the first of the effects, and what it knows of the mesh's error.

        Returns
        -------
        (q + e + k,) array
            Where that fit is.
        """
        first, coefficients = self._U.shape[1], np.concatenate(smaller.coefficients)
        at = np.zeros(len(self.z))
        at[: len(smaller.nuisances)] = smaller.nuisances
        at[first : first + len(coefficients)] = coefficients
        self.columns, self._made_at = columns, at
        if smaller.share is not None:
            self._share = smaller.share.among(len(self.z) - first)
        return at

    def _know(self, share: Share) -> None:
        """Take a share of all mechanisms in the place of that which was known."""
        own, before = slice(self._U.shape[1], None), self._share
        self.columns = self.columns.copy()
        if before is not None:
            self.columns[:, own] -= np.outer(before.answer, before.along)
        self.columns[:, own] += np.outer(share.answer, share.along)
        self._share = share

    def _columns_solved(self) -> Floats:
        """Columns with those of tissue and mechanisms from states that are solved beside this one."""
        columns = self.columns.copy()
        numbers = np.arange(len(self.z))
        for k in (*numbers[self._tissue].tolist(), *numbers[self._U.shape[1] :].tolist()):
            beside = self.z + _BESIDE * np.eye(1, len(self.z), k)[0]
            try:
                columns[:, k] = (self.residual - self._try(beside, self.state)[1]) / _BESIDE
            except (SolveError, InputError):
                continue
        return columns

    def _columns_here(self) -> Floats:
        """Columns with those of tissue, field and mechanisms made anew where they are now."""
        columns, state, base, mesh = self.columns.copy(), self.state, self._base, self._fits.mesh_errors
        at = None
        # what was solved over time has no one state to be linear about
        if all(effect.about is None for effect in self._effects):
            try:
                at = self._at = Linearisation(state.system, state.u, state.reactions, state.sensors)
            except SolveError:
                return columns
            early = self._early()
            tissue = early * tissue_columns(at, base.states, state.hypothesis.theta, base.prior)
            columns[:, self._tissue] = tissue + mesh_by_tissue(state.sensors, mesh)
            columns[:, self._field] = early * field_columns(at, base.states)
        for effect, own in zip(self._effects, self._own, strict=True):
            here = effect.coefficients(self.z[own])
            if effect.about is not None:
                columns[:, own] = effect.about(here)
            elif at is not None and not effect.proposed.is_there_or_not:
                made = Effects(at, mesh_errors=mesh)
                columns[:, own] = made.of([_about(effect.proposed, here)], effect.proposed.make(here))[0].columns
            else:
                continue
            if self._share is not None:
                along = self._share.along[own.start - self._own[0].start : own.stop - self._own[0].start]
                columns[:, own] += np.outer(self._share.answer, along)
        return columns

    def _early(self) -> Floats:
        """How many times what tissue does in the end (n, 1) it does where it has not relaxed."""
        sensors = self.state.sensors
        stiffer = np.ones(len(sensors))
        for effect, own in zip(self._effects, self._own, strict=True):
            if effect.proposed.history is not None:
                stiffer += np.maximum(parts_of(effect.proposed, effect.coefficients(self.z[own]), sensors), 0.0)
        return np.where(sensors.is_displacement, 1.0 / stiffer, stiffer)[:, None]

    def result(self) -> Refit:
        """The fit at its best point."""
        base, z = self._base, self.z
        q = self._U.shape[1]
        linear = self.residual + self.columns @ z
        evidence = marginal(base.model.of_noise(self.columns), linear, base.points, self._scale)
        columns = np.column_stack([self.columns, *self._unsure(z[q:])])
        # of the size of the mechanism what is unsure says something, of its evidence nothing
        W = self._noise.whitened(columns)
        covariance = np.asarray(np.linalg.inv(np.eye(W.shape[1]) + W.T @ W), dtype=np.float64)
        # where the amount would go with it, or had the search not ended, is not where it is said to be
        away = (covariance @ (W.T @ self._noise.whitened(linear)))[: len(z)] - z
        return Refit(
            self._effects,
            self.state,
            z[:q],
            tuple(z[own] for own in self._own),
            tuple(covariance[own, own] + np.outer(away[own], away[own]) for own in self._own),
            self.residual,
            linear,
            self.columns,
            evidence,
            self.converged,
            self._share,
        )

    def _unsure(self, z: Floats) -> list[Floats]:
        """Columns (n, 1) of what is not known of the mesh's share of mechanisms.

        On meshes that lock it is as large as the effect itself: far from where the power is known with which it falls.
        """
        return [] if self._share is None else [belief("mesh.share") * self._share.at(z)[:, None]]


def _slices(effects: Sequence[Effect], first: int) -> list[slice]:
    """Where the coordinates of each effect are."""
    ends = np.cumsum([first, *(effect.columns.shape[1] for effect in effects)]).tolist()
    return [slice(low, high) for low, high in itertools.pairwise(ends)]


def _about(proposal: Proposal, here: Floats) -> Proposal:
    """The proposal from which the columns about some coefficients (k,) follow."""
    if proposal.changes_in_time:
        return replace(proposal, mean=here)
    return replace(proposal, follows="smooth", start=here)
