"""Fits a hypothesis to some of the tests without linearising, and says how probable it then is.

Levenberg's steps to the most probable coefficients; evidence by Laplace about them, averaged over the scale of the
noise (`warpbrain.diagnosis.evidence`). A step that makes no sense to a mechanism is shortened, never taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.diagnosis.specimen.forward import Forward, Hypothesis
from warpbrain.diagnosis.specimen.material import NoStateError
from warpbrain.errors import InputError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_STEPS, _DONE = 40, 1e-3
#: A scale of the noise that every fit is begun with too: residuals that are large at first do not trap it; how often a
#: fit is repeated with the scale that it found, and when that is enough.
_LOOSE, _SETTLING, _SETTLED = 3.0, 4, 0.05
#: What a hypothesis raises whose coefficients cannot be.
_CANNOT_BE = (InputError, NoStateError, OverflowError, np.linalg.LinAlgError)
#: Times that the shape of glued ends is computed anew for the law that was arrived at.
_REFRESHED = 2


@dataclass(frozen=True, eq=False)
class SpecimenFit:
    """A hypothesis at its most probable coefficients.

    Attributes
    ----------
    hypothesis : Hypothesis
    z : (k,) array
        In standard deviations.
    covariance : (k, k) array
    stress : (n,) array
        At all rows, fitted or not [Pa].
    columns : (n, k) array
        Change with each coefficient.
    rows : (n,) bool array
        That were fitted.
    kappa : float
        Factor on the noise.
    log_evidence : float
    explanation : Explanation
        Of the fitted rows, all coefficients among its nuisances.
    whitened : (m,) array
        Residual of the fitted rows with all coefficients at zero, whitened.
    """

    hypothesis: Hypothesis
    z: Floats
    covariance: Floats
    stress: Floats
    columns: Floats
    rows: Bools
    kappa: float
    log_evidence: float
    explanation: Explanation
    whitened: Floats


class Fitting:
    """Fits hypotheses to tests.

    Parameters
    ----------
    forward : Forward
    factor : (n, n) array
        Of the noise, see `noise_factor`.
    """

    def __init__(self, forward: Forward, factor: Floats) -> None:
        self.forward, self.factor = forward, factor

    def fit(
        self,
        hypothesis: Hypothesis,
        rows: Bools,
        begin: Sequence[Floats] = (),
        kappa: float = 1.0,
        refresh: bool = True,
    ) -> SpecimenFit | None:
        """The most probable of the fits that begin at some points; None if none of them stands.

        Parameters
        ----------
        hypothesis : Hypothesis
        rows : (n,) bool array
            That are fitted.
        begin : sequence of (k,) arrays
            Where to begin; 0 if there are none.
        kappa : float
            Factor on the noise to begin with.
        refresh : bool
            Whether the shape of glued ends follows the law.
        """
        starts = begin or [np.zeros(self.forward.size(hypothesis))]
        if refresh:
            self.forward.use_shape_of(self.forward.material(hypothesis, starts[0]))
        scales = [(z, kappa) for z in starts] + ([(starts[0], _LOOSE)] if kappa < 0.7 * _LOOSE else [])
        found = [self._settled(hypothesis, rows, z, scale) for z, scale in scales]
        stand = [one for one in found if one is not None]
        if not stand:
            return None
        best = max(stand, key=lambda one: one.log_evidence)
        for _ in range(_REFRESHED if refresh else 0):
            if not self.forward.use_shape_of(self.forward.material(hypothesis, best.z)):
                break
            best = self._settled(hypothesis, rows, best.z, best.kappa) or best
        return best

    def _settled(self, hypothesis: Hypothesis, rows: Bools, z: Floats, kappa: float) -> SpecimenFit | None:
        """A fit whose scale of the noise is the one that it was made with."""
        found = self._from(hypothesis, rows, z, kappa)
        for _ in range(_SETTLING):
            if found is None or abs(found.kappa / kappa - 1.0) < _SETTLED:
                break
            kappa = found.kappa
            again = self._from(hypothesis, rows, found.z, kappa)
            if again is None or again.log_evidence < found.log_evidence:
                break
            found = again
        return found

    def _from(self, hypothesis: Hypothesis, rows: Bools, z: Floats, kappa: float) -> SpecimenFit | None:
        stress = self._try(hypothesis, z)
        if stress is None:
            return None
        factor = self.factor[np.ix_(rows, rows)]
        observed = self.forward.protocol.observed[rows]
        whiten = Explanation(factor, np.zeros((len(factor), 1))).whitened
        damping, columns = 1e-3, self._try_tangent(hypothesis, z, stress)
        if columns is None:
            return None
        fresh = True
        cost = _cost(whiten(observed - stress[rows]), z, kappa)
        for _ in range(_STEPS):
            if fresh:
                J = whiten(columns[rows]) / kappa
                r = whiten(observed - stress[rows]) / kappa
                gram, right, fresh = J.T @ J + np.eye(len(z)), J.T @ r - z, False
            step = np.linalg.solve(gram + damping * np.diag(np.diag(gram)), right)
            step *= min(1.0, 2.0 / max(float(np.abs(step).max()), 1e-12))
            moved = self._try(hypothesis, z + step)
            new = np.inf if moved is None else _cost(whiten(observed - moved[rows]), z + step, kappa)
            if moved is None or new >= cost:
                damping *= 6.0
                if damping > 1e8:
                    break
                continue
            gained, cost, z, stress = cost - new, new, z + step, moved
            damping = max(0.2 * damping, 1e-9)
            there = self._try_tangent(hypothesis, z, stress)
            if there is None:
                return None
            columns, fresh = there, True
            if gained < _DONE:
                break
        return self._concluded(hypothesis, rows, z, stress, columns, factor)

    def _concluded(
        self,
        hypothesis: Hypothesis,
        rows: Bools,
        z: Floats,
        stress: Floats,
        columns: Floats,
        factor: Floats,
    ) -> SpecimenFit:
        explanation = Explanation(factor, columns[rows])
        residual = self.forward.protocol.observed[rows] - stress[rows] + columns[rows] @ z
        white = explanation.whitened(residual)
        log_evidence = float(explanation.log_marginal(white[:, None])[0])
        kappa = explanation.best_kappa(white)
        W = explanation.whitened(columns[rows]) / kappa
        covariance = np.asarray(np.linalg.inv(np.eye(len(z)) + W.T @ W), dtype=np.float64)
        # at a limit of a parameter the linear model has a better point than there is
        there = _cost(white / kappa - W @ z, z, 1.0)
        beyond = covariance @ (W.T @ (white / kappa))
        log_evidence -= max(there - _cost(white / kappa - W @ beyond, beyond, 1.0), 0.0)
        return SpecimenFit(
            hypothesis, z, covariance, stress, columns, rows, kappa, log_evidence, explanation, white
        )  # fmt: skip

    def _try(self, hypothesis: Hypothesis, z: Floats) -> Floats | None:
        try:
            with np.errstate(all="ignore"):
                found = self.forward.stress(hypothesis, z)
        except _CANNOT_BE:
            return None
        return found if np.isfinite(found).all() else None

    def _try_tangent(self, hypothesis: Hypothesis, z: Floats, stress: Floats) -> Floats | None:
        """None at the edge of what can be."""
        try:
            with np.errstate(all="ignore"):
                found = self.forward.tangent(hypothesis, z, stress)
        except _CANNOT_BE:
            return None
        return found if np.isfinite(found).all() else None


def _cost(residual: Floats, z: Floats, kappa: float) -> float:
    return float(0.5 * residual @ residual / kappa**2 + 0.5 * z @ z)
