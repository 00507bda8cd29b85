"""One search for the best point of a set of causes: Gauss-Newton's method on standard normal coordinates.

Coordinates of tissue, field and mechanisms act through an equilibrium, those of other nuisances linearly. Columns are
made anew where the coordinates have moved away from. What other shapes of laws and mechanisms do, the error of the
mesh, noise and gross errors stay as they are during a search, and are then taken from the point that it came to.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.finer_mesh import Difference
from warpbrain.inference.beliefs import belief
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.physics.mechanism import Mechanism
from warpbrain.simulation.equilibrium import EquilibriumOptions
from warpbrain.simulation.multisecant import extrapolated
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.effects import Effect, width_of
from warpbrain.worlds.body.evidence import SetMarginal, Sizes, evidence_of
from warpbrain.worlds.body.fit_columns import Layout, columns_about, shape_columns_about
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.mesh_error import FinerStates, MeshErrors, expected
from warpbrain.worlds.body.nuisances import MESH_SHARE, UNKNOWN_MESH, RigidMotion, mesh_by_tissue
from warpbrain.worlds.body.parameters import log_within_expected
from warpbrain.worlds.body.states import Hypothesis, SolvedState
from warpbrain.worlds.body.weighted_set import MeshShare, Refit, excess_error, mesh_share_of

_ITERATIONS = 20
#: Trials along a step; along one from columns that were made elsewhere, which may point uphill.
_TRIALS, _TRIALS_ELSEWHERE = 6, 2
#: Parts of the way from no effect that a fit begins at if there is no equilibrium where it would begin.
_SHARES = 0.5, 0.25, 0.125
#: Part of a step that is tried next, at least and at most.
_SHORTER, _SHORT = 0.1, 0.5
#: How far [standard deviations] coordinates go until columns are made anew.
_RELINEARISE = 0.3
#: The same at the end of a search: rounding decides which step is the last one, and the result must not depend on it.
_NEAR = 0.1
#: Earlier states from which the next one is extrapolated at most.
_KEPT = 9
#: Steps that are expected to gain less of the log posterior density than this end the search (half the square of
#: Newton's decrement, Boyd and Vandenberghe 2004, section 9.5.1); the same as long as laws, error of the mesh and noise
#: are those of another point. In 94 fits of 14 cases (run 43) the log evidence at 0.1 differs from that at 0.02 by 0.13
#: (RMS), and by 0.69 at most.
ENOUGH, ROUGHLY = 0.1, 1.0
#: Part of the expected gain of a step; where less is gained, columns that were made about another point are made anew.
_AGREES = 0.5
#: By how much an error of the mesh changes that is worth going on [standard deviations: of the noise, all sensors
#: together, and of what is not known of that error].
_MATTERS = 0.3
#: Change of the columns of laws that is none [standard deviations of the noise, all sensors together].
_UNSEEN = 1e-3
#: Gain of a step that may be rounding.
_ROUNDING = 0.02


class FitSearch:
    """One fit on its way: the best point so far, and the columns of the linear model about it.

    `mesh_errors`: without the share of mechanisms; None: the mesh is taken for exact. `effects`, `columns`, `screened`:
    see `warpbrain.worlds.body.fitting.Fitter`. `z` (q + e + k,): coordinates of the best point. `residual` (n,),
    `columns` (n, q + e + k).
    """

    def __init__(
        self,
        base: Base,
        mesh_errors: MeshErrors | None,
        effects: tuple[Effect, ...],
        columns: Floats,
        screened: SetMarginal,
    ) -> None:
        self._base, self.mesh_errors, self.effects = base, mesh_errors, effects
        self._marginal, self._noise = screened, screened.noise
        nuisances = base.nuisances
        count = columns.shape[1] - width_of(effects)
        self._layout = Layout.of(nuisances, screened.sizes, count, effects)
        columns = columns.copy()
        columns[:, [law for law, _, _ in self._layout.shared]] = 0.0
        self._U = columns[:, :count]
        # recordings were realigned by a rigid motion already, which keeps its prior cost as coordinates; another one is
        # no linear change of what moved far
        self._rigid = RigidMotion(base.states, nuisances)
        self._linear = self._layout.linear.copy()
        self._linear[self._rigid.part] = False
        # nonlinear coordinates and displacements of states of this fit
        self._solved: list[tuple[Floats, Floats]] = []
        self._mesh_share: MeshShare | None = None
        # coefficients (k,) at which that was computed in this fit
        self._share_computed_at: Floats | None = None
        # the state that was linearised last, and the coordinates of that of the columns
        self._nearby = base.at
        self._linearised_at = np.full(len(self._layout.nonlinear), np.inf)
        # whether the columns lack a share of the mesh's error that residuals have
        self._outdated = False
        # of the last state of this fit that was followed over time
        self._course: tuple[Floats, ...] = ()
        self.columns = columns
        # the linear model about a state, and the coefficients of effects there, until columns of shapes are made of it
        self._about: tuple[Linearisation, tuple[Floats, ...]] | None = None
        # columns of shapes about the last linearisation, how they differed from those before, and the part
        # of such a difference that is taken
        self._shapes: Floats | None = None
        self._shape_change, self.taken = np.zeros((len(self._U), 1)), 1.0
        #: What the linear model expects of the rest of such a difference [nats].
        self.left_of_shapes = 0.0
        # columns and noise at which linear coordinates were put at their best last, and what that needs of these
        self._projection: tuple[Floats, GaussianModel, Floats, tuple[Floats, bool]] | None = None
        # where the error of the mesh was computed last
        self._mesh_error_at: Floats | None = None
        self.state, self.converged = base.state, False
        self.z, self.residual, self._best = np.zeros(self.columns.shape[1]), np.zeros(len(self._U)), np.inf

    def start(self, starts: Sequence[Floats], nearby: SolvedState) -> None:
        """Take the best of some coordinates, within limits."""
        self._best = np.inf
        for number, start in enumerate(starts, 1):
            z = self._clipped(self._layout.without_shared(start))
            try:
                self._accept_if_better(*self._trial(z, nearby))
            except (SolveError, InputError):
                if number == len(starts) and not np.isfinite(self._best):
                    raise

    def start_toward(self, start: Floats, nearby: SolvedState) -> None:
        """Take the farthest point with an equilibrium on the way to coordinates that have none.

        What data ask for in the linear model may collapse the body, which is no evidence against less of the same.
        `SolveError` if there is none.
        """
        end = self._clipped(self._layout.without_shared(start))
        without = self._at_base(end)
        for effect, part in zip(self.effects, self._layout.effects, strict=True):
            without[part] -= effect.offset(without[part])
        for share in _SHARES:
            # from rest: what is known nearby has no equilibrium with all of these
            self._solved = []
            try:
                return self.start([without + share * (end - without)], nearby)
            except SolveError:
                if share == _SHARES[-1]:
                    raise

    def _at_base(self, z: Floats) -> Floats:
        """Coordinates with tissue and stiffness field of the base."""
        base = z.copy()
        coordinates = self._base.nuisances.coordinates(self._base.prior, self._base.state.hypothesis)
        base[self._layout.tissue] = coordinates[self._layout.tissue]
        base[self._layout.field] = coordinates[self._layout.field] / self._layout.field_size
        return base

    def begin_at(self, subset: Refit, about: Linearisation | None = None) -> Floats:
        """Take the columns for those about a fit with the first of the effects, or all; keep its share of the mesh.

        `about`: of its state, if it was linearised. Returns (q + e + k,): coordinates of that fit.
        """
        first, coefficients = self._U.shape[1], np.concatenate([np.zeros(0), *subset.coefficients])
        z, nuisances = np.zeros(len(self.z)), self._base.nuisances
        of_field = nuisances.field_sizes.relative[subset.marginal.sizes.field] / self._layout.field_size
        z[: len(subset.nuisances)] = nuisances.with_field(subset.nuisances[None], of_field)[0]
        # about as large as there
        part = nuisances.part(UNKNOWN_MESH)
        sizes = [float(np.linalg.norm(columns[:, part])) for columns in (subset.columns, self.columns)]
        z[part] *= sizes[0] / sizes[1] if sizes[1] else 1.0
        z[first : first + len(coefficients)] = coefficients
        self._linearised_at, self._nearby = z, about or self._nearby
        if not any(effect.is_release for effect in self.effects[len(subset.effects) :]):
            # a place that leads to no state nearby is given up soon: from rest, in load steps, that takes minutes
            self._solved = [(z[self._layout.nonlinear], subset.state.u)]
        if subset.mesh_share is not None:
            share = subset.mesh_share.extended(len(self.z) - first)
            self._take_mesh_share(share, z[first:])
            self._outdated = True
        return z

    def _take_mesh_share(self, share: MeshShare, z: Floats) -> None:
        """Take a share of the mesh's error for that of the mechanisms, known to a part only, about coefficients (k,).

        On meshes that lock it is as large as the effect itself: there the error does not yet fall with the power of the
        element size that is assumed.
        """
        nuisances, unknown = self._base.nuisances, belief("mesh.share") * share.at(z)[:, None]
        self._U = nuisances.with_family(MESH_SHARE, self._U, unknown)
        self.columns = nuisances.with_family(MESH_SHARE, self.columns, unknown)
        self._mesh_share = share

    def backtrack_to_base(self) -> None:
        """Move tissue and field toward the base while that is better: far from it the linear model may fail.

        The best point stays where there is no equilibrium on the way: the body may collapse with softer tissue.
        """
        base = self._at_base(self.z)
        far = self.z
        for share in (0.5, 0.0):
            try:
                if not self._accept_if_better(*self._trial(base + share * (far - base), self.state)):
                    return
            except (SolveError, InputError):
                return

    def minimise(self, enough: float = ENOUGH) -> None:
        """Go to the best point nearby by Gauss-Newton's method, with columns made anew on the way.

        `enough`: what a step has to gain to be taken.
        """
        self.converged, elsewhere = False, np.full(len(self.z), np.inf)
        for iteration in range(_ITERATIONS):
            if self._outdated or (iteration > 0 and self._moved() > _RELINEARISE):
                self._relinearise()
            self.columns = self._rigid.renewed(self.columns, self.state.sensors, self.z)
            (step, gain), current = self._gauss_newton_step(), np.array_equal(self._linearised_at, self.z)
            if gain < enough:
                self.converged = not _NEAR < self._moved() < np.inf
                if self.converged or enough > ENOUGH:
                    return
                self._linearised_at = elsewhere
                continue
            gained = self._line_search(step, gain, _TRIALS if current else _TRIALS_ELSEWHERE)
            if not current and gained < _AGREES * gain:
                # columns that were made elsewhere may point uphill
                self._linearised_at = elsewhere
            elif gained < _ROUNDING:
                # no better point lies this way: the last good one stands
                return

    def _moved(self) -> float:
        """How far the best point is from where its columns were made [standard deviations]; infinite if not known.

        All coordinates together: those of a vector are others in other axes, which must not matter.
        """
        return float(np.linalg.norm((self.z - self._linearised_at)[self._layout.nonlinear]))

    def expected_gain(self) -> float:
        """Of the log posterior density by another step, in the linear model."""
        return self._gauss_newton_step()[1]

    def update_noise(self, fit: Refit) -> None:
        """Take noise, gross errors, the mesh's unknown error and the size of the stiffness field of a result."""
        marginal, nuisances = fit.marginal, self._base.nuisances
        self._take_field_size(marginal.sizes)
        same = marginal.scale == self._marginal.scale and np.array_equal(marginal.gross, self._marginal.gross)
        same &= marginal.model.noise_factor is self._marginal.model.noise_factor
        self._marginal, self._noise = marginal, marginal.noise
        part = nuisances.part(UNKNOWN_MESH)
        unknown, before = fit.columns[:, part], self.columns[:, part]
        if np.linalg.norm(unknown - before) > _MATTERS * np.linalg.norm(before):
            same = False
            self.residual = self.residual + before @ self.z[part] - unknown @ fit.nuisances[part]
            self.z = self.z.copy()
            self.z[part] = fit.nuisances[part]
            self._U = nuisances.with_family(UNKNOWN_MESH, self._U, unknown)
            self.columns = nuisances.with_family(UNKNOWN_MESH, self.columns, unknown)
        if not same:
            self._renew(self.residual)

    def _take_field_size(self, sizes: Sizes) -> None:
        """Take the size of the stiffness field in `sizes`: the best point has other coordinates of the same field."""
        size = float(self._base.nuisances.field_sizes.relative[sizes.field])
        if size == self._layout.field_size:
            return
        factor = size / self._layout.field_size
        self._layout, scaled = replace(self._layout, field_size=size), self._base.nuisances.with_field
        self.z, self._linearised_at = (scaled(at[None], 1.0 / factor)[0] for at in (self.z, self._linearised_at))
        self._U, self.columns = scaled(self._U, factor), scaled(self.columns, factor)
        field = self._layout.field_of_nonlinear
        self._solved = [(np.where(field, at / factor, at), u) for at, u in self._solved]
        self._renew(self.residual)

    def update_mesh_share(self, known: MeshErrors, finer: FinerStates) -> None:
        """Compute the mechanisms' share of the mesh's error at the best point, where a finer mesh tells it.

        It is in proportion to the mechanisms: where these have hardly changed it is not computed again.
        """
        coefficients, prior = [self.z[part] for part in self._layout.effects], self._base.prior
        least = _MATTERS * belief("mesh.share")
        if self._share_computed_at is not None:
            offsets = [effect.offset(z) for effect, z in zip(self.effects, coefficients, strict=True)]
            moved = float(np.linalg.norm(self.z[self._layout.coefficients] - self._share_computed_at))
            if moved <= least * float(np.linalg.norm(np.concatenate(offsets))):
                return
        before, z = self._mesh_share, self.z[self._layout.coefficients]
        share = mesh_share_of(self.effects, coefficients, self.state, known, finer, prior)
        self._share_computed_at = z
        if share is None:
            return
        before_U = self._U
        self._take_mesh_share(share, z)
        change, by_coefficients = share.at(z), share.columns()
        if before is not None:
            change, by_coefficients = change - before.at(z), by_coefficients - before.columns()
        self.columns[:, self._layout.coefficients] += by_coefficients
        self._renew(self.residual - change + (before_U - self._U) @ self.z[: self._U.shape[1]])

    def update_mesh_errors(self, known: MeshErrors, finer: FinerStates) -> MeshErrors:
        """Take the error of the mesh of tissue alone at the best point, unless that is where it was computed last."""
        at, before = self.z[self._layout.nonlinear], self._mesh_error_at
        if before is not None and np.linalg.norm(at - before) <= _NEAR:
            return known
        self._mesh_error_at = at
        try:
            error = finer.error(self.state.hypothesis, self.state)
        except SolveError:
            return known
        change = excess_error(known, error, self.state, self._base.prior)
        renewed = known.with_error(error, self._base.prior)
        if float(np.linalg.norm(self._noise.whitened(change))) > _MATTERS:
            sensors, self.mesh_errors = self.state.sensors, renewed
            self.columns[:, self._layout.tissue] += mesh_by_tissue(sensors, renewed) - mesh_by_tissue(sensors, known)
            self.start([self.z], self.state)
        return renewed

    def result(self) -> Refit:
        """The fit at its best point."""
        q = self._U.shape[1]
        linear = self.residual + self.columns @ self.z
        columns, evidence = evidence_of(self._base, self.columns, linear, self._marginal.sizes, self._marginal.scale)
        nuisances = self._base.nuisances
        of_field = self._layout.field_size / nuisances.field_sizes.relative[evidence.sizes.field]
        part, z = nuisances.part(UNKNOWN_MESH), nuisances.with_field(self.z[None], of_field)[0]
        z[part] = evidence.coordinates(linear)[part]
        W = self._noise.whitened(columns)
        covariance = np.asarray(np.linalg.inv(np.eye(W.shape[1]) + W.T @ W), dtype=np.float64)
        # how far the best point would move if the search had gone on is uncertainty, too
        shift = covariance @ (W.T @ self._noise.whitened(linear)) - z
        coefficients = tuple(z[part] for part in self._layout.effects)
        covariances = tuple(covariance[p, p] + np.outer(shift[p], shift[p]) for p in self._layout.effects)
        return Refit(
            self.effects,
            self.state,
            z[:q],
            coefficients,
            covariances,
            linear - columns @ z,
            linear,
            columns,
            evidence,
            self.converged,
            self._mesh_share,
            within_expected=sum(map(log_within_expected, self.effects, coefficients, covariances)),
        )

    def update_shapes(self) -> None:
        """Replace the columns of the shape of laws and of mechanisms by those of the last linearisation.

        While an optimum is looked for they are fixed: renewed on the way, they would change the objective. Where a
        renewal undoes what the one before has done, as between two states that have each other's columns, half of it is
        taken from then on.
        """
        part, before = self._layout.shapes, self._U[:, self._layout.shapes]
        if self._about is not None:
            at, coefficients = self._about
            self._shapes = shape_columns_about(at, self.effects, coefficients, self._base.states)
            self._about = None
            change = self._base.model.whitened(self._shapes - before)
            # about the same point they are the same but for rounding, which undoes nothing
            if float(np.linalg.norm(change)) > _UNSEEN:
                if float(np.sum(change * self._shape_change)) < 0.0:
                    self.taken *= 0.5
                self._shape_change = change
        if self._shapes is None or np.array_equal(self._shapes, before):
            return
        columns, gain = before + self.taken * (self._shapes - before), self.expected_gain()
        residual = self.residual + (before - columns) @ self.z[part]
        self._U, self.columns = self._U.copy(), self.columns.copy()
        self._U[:, part] = self.columns[:, part] = columns
        self._renew(residual)
        # gains grow with the square of a change
        self.left_of_shapes = max(self.expected_gain() - gain, 0.0) * (1.0 / self.taken**2 - 1.0)

    def _gauss_newton_step(self) -> tuple[Floats, float]:
        """The step and what it gains in the linear model.

        Coordinates at a limit that the step would leave stay there (projected Newton, Bertsekas 1982): clipped with the
        others as they are, the step need not be downhill.
        """
        free, limited = np.ones(len(self.z), dtype=bool), np.zeros(len(self.z), dtype=bool)
        limited[self._layout.tissue] = limited[self._layout.field] = True
        limited &= np.abs(self.z) >= belief("tissue.farthest") * (1.0 - 1e-9)
        white = self._noise.whitened(np.column_stack([self.residual, self.columns]))
        W = white[:, 1:]
        gradient = W.T @ white[:, 0] - self.z
        while True:
            kept, step = np.flatnonzero(free), np.zeros(len(self.z))
            step[kept] = np.linalg.solve(np.eye(len(kept)) + W[:, kept].T @ W[:, kept], gradient[kept])
            leaving = free & limited & (step * self.z > 0.0)
            if not leaving.any():
                return step, 0.5 * float(gradient @ step)
            free &= ~leaving

    def _line_search(self, step: Floats, gain: float, trials: int) -> float:
        """Go along a step, shortened until it is downhill; by how much the best point is better.

        The next length is that at which a parabola is least, by its slope, twice the `gain` that is expected of the
        whole step, and by what was found (Nocedal and Wright 2006, section 3.5).
        """
        length, before = 1.0, self._best
        for _ in range(trials):
            trial, shorter = self._clipped(self.z + length * step), _SHORT
            try:
                trial, state, residual = self._trial(trial, self.state)
            except (SolveError, InputError):
                pass
            else:
                if self._accept_if_better(trial, state, residual):
                    return before - self._best
                slope = 2.0 * gain * length
                shorter *= slope / (self._objective(trial, residual) - before + slope)
            length *= max(shorter, _SHORTER)
        return 0.0

    def _objective(self, z: Floats, residual: Floats) -> float:
        white = self._noise.whitened(residual)
        return 0.5 * float(white @ white + z @ z)

    def _renew(self, residual: Floats) -> None:
        """Take another residual (n,) at the best point, whose objective is another one from now on."""
        self._best = np.inf
        z, residual = self._with_best_linear(self.z, residual)
        self._accept_if_better(z, self.state, residual)

    def _trial(self, z: Floats, nearby: SolvedState) -> tuple[Floats, SolvedState, Floats]:
        """Coordinates with the linear ones at their best, and the state and residual there."""
        state, residual = self._evaluate(z, nearby)
        z, residual = self._with_best_linear(z, residual)
        return z, state, residual

    def _with_best_linear(self, z: Floats, residual: Floats) -> tuple[Floats, Floats]:
        """Coordinates with the linear ones at their best, which needs no equilibrium, and the residual there.

        Variable projection (Golub and Pereyra 1973): a step that is shortened for the sake of the state is not so for
        these, and where columns of laws are made anew these follow at once.
        """
        from scipy.linalg import cho_factor, cho_solve

        if self._projection is None or self._projection[0] is not self._U or self._projection[1] is not self._noise:
            W = self._noise.whitened(self._U[:, self._linear])
            factor = cho_factor(np.eye(W.shape[1]) + W.T @ W, lower=True, check_finite=False)
            self._projection = self._U, self._noise, W, factor
        *_, W, factor = self._projection
        gradient = W.T @ self._noise.whitened(residual) - z[: len(self._linear)][self._linear]
        change = np.zeros(len(self._linear))
        change[self._linear] = cho_solve(factor, gradient, check_finite=False)
        z = z.copy()
        z[: len(change)] += change
        return z, residual - self._U @ change

    def _accept_if_better(self, z: Floats, state: SolvedState, residual: Floats) -> bool:
        objective = self._objective(z, residual)
        if not objective <= self._best + 1e-9:
            return False
        self.z, self.state, self.residual, self._best = z, state, residual, objective
        return True

    def _clipped(self, z: Floats) -> Floats:
        clipped, farthest = z.copy(), belief("tissue.farthest")
        for part in (self._layout.tissue, self._layout.field):
            clipped[part] = np.clip(clipped[part], -farthest, farthest)
        return clipped

    def _evaluate(self, z: Floats, nearby: SolvedState) -> tuple[SolvedState, Floats]:
        """State and residual at coordinates."""
        base, layout, mesh = self._base, self._layout, self.mesh_errors
        mechanisms: list[Mechanism] = []
        patches = []
        for effect, part in zip(self.effects, layout.effects, strict=True):
            mechanisms += effect.proposed.acting(effect.coefficients(z[part]))
            if effect.proposed.patch is not None:
                patches.append(effect.proposed.patch)
        theta = base.prior.mean + base.prior.factor @ z[layout.tissue]
        hypothesis = Hypothesis(theta, layout.field_size * z[layout.field], tuple(mechanisms), tuple(patches))
        error = None if mesh is None else expected(mesh.of(theta, base.prior))
        state = self._solve(hypothesis, z[layout.nonlinear], nearby, error)
        self._course = state.course or self._course
        q = self._U.shape[1]
        residual = state.sensors.residual - self._U[:, self._linear] @ z[:q][self._linear]
        residual = residual + self._rigid.change(state.sensors, z)
        if self._mesh_share is not None:
            residual = residual - self._mesh_share.at(z[q:])
        for effect, part in zip(self.effects, layout.effects, strict=True):
            if effect.proposed.is_there_or_not:
                # the state has a switch as a whole: its coefficient is how exactly it is simulated
                residual = residual - effect.columns @ z[part]
        return state, residual

    def _solve(
        self, hypothesis: Hypothesis, nonlinear: Floats, nearby: SolvedState, error: Difference | None
    ) -> SolvedState:
        """The state at nonlinear coordinates, begun at an extrapolation of those of this fit."""
        states = self._base.states
        start, course = (
            extrapolated(self._solved, nonlinear) if self._solved else nearby.u,
            nearby.course or self._course,
        )
        # where states of this fit are known a step that leads to none nearby is shortened: from rest, in load steps, a
        # law that stiffens exponentially takes minutes to fail
        most = EquilibriumOptions.max_newton if self._solved else EquilibriumOptions.max_total_newton
        known = nearby.u if self._solved else None
        try:
            state = states.solve(hypothesis, start, error, course, most, self._nearby, known)
        except SolveError:
            if self._solved:
                raise
            state = states.solve(hypothesis, None, error)
        self._solved = [*self._solved[-_KEPT:], (nonlinear, state.u)]
        return state

    def _relinearise(self) -> None:
        """Make the columns of tissue, field and mechanisms anew at the best point, unless nothing is linear there."""
        self._linearised_at, self._outdated = self.z, False
        base, share = self._base, self._mesh_share
        try:
            columns, at = columns_about(
                self.state, self.z, self.columns, self._layout, self.effects, base, self.mesh_errors, share
            )
        except SolveError:
            return
        self.columns, self._nearby = columns, at
        self._about = at, tuple(self.z[part] for part in self._layout.effects)
