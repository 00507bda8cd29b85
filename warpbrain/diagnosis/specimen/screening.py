"""Whether a fit leaves anything that candidates, or any smooth change of the tests, would explain: to first order.

The probability of as much under noise and nuisances alone is found by drawing residuals, so that having looked for many
things, in many ways, is paid for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import Explanation, Stack, kappa_log_prior
from warpbrain.diagnosis.screening import log_unknown
from warpbrain.diagnosis.specimen.acting import Assumption
from warpbrain.diagnosis.specimen.fitting import SpecimenFit
from warpbrain.diagnosis.specimen.forward import Forward
from warpbrain.diagnosis.specimen.material import NoStateError
from warpbrain.diagnosis.specimen.noise import smooth_patterns
from warpbrain.diagnosis.stack_evidence import StackEvidence
from warpbrain.errors import InputError
from warpbrain.worlds.body.effects import Effect

Floats = NDArray[np.float64]

#: Sizes of smooth changes that are no mechanism, of the largest stress of each test.
SIZES = (0.05, 0.15, 0.4)


@dataclass(frozen=True, eq=False)
class Columns:
    """What a candidate changes, to first order.

    Attributes
    ----------
    kind : str
    assumption : Assumption or None
        None of smooth changes.
    columns : (m, k) array
        At the fitted rows [Pa]: what is expected of it beforehand, if that is not nothing, and one standard deviation
        of each coefficient.
    expects : bool
        Whether the first of them is what is expected.
    """

    kind: str
    assumption: Assumption | None
    columns: Floats
    expects: bool


def columns_of(forward: Forward, fit: SpecimenFit, ways: Mapping[str, Sequence[Assumption]]) -> list[Columns]:
    """Of every way of every kind at a fit, and of smooth changes."""
    found = []
    for kind, own in ways.items():
        for one in own:
            hypothesis = fit.hypothesis.with_more(one)
            z = np.concatenate([fit.z, np.zeros(len(one.mean))])
            try:
                there = forward.stress(hypothesis, z)
                tangent = forward.tangent(hypothesis, z, there)[:, len(fit.z) :]
            except (InputError, NoStateError):
                continue
            moved = there - forward.stress(fit.hypothesis, fit.z)
            expects = bool(np.abs(moved).max() > 1e-6 * np.abs(there).max())
            columns = np.column_stack([moved, tangent]) if expects else tangent
            found.append(Columns(kind, one, columns[fit.rows], expects))
    for size in SIZES:
        found.append(Columns("unknown", None, smooth_patterns(forward.protocol, size)[fit.rows], False))
    return found


def p_value(fit: SpecimenFit, columns: Sequence[Columns], draws: int, rng: np.random.Generator) -> float:
    """Probability of residuals that candidates explain as well as these, if nothing is missing."""
    nothing = np.zeros(int(fit.rows.sum()))
    stack = fit.explanation.stack([Effect(None, nothing, one.columns) for one in columns])
    kinds = [one.kind for one in columns]
    own = _alarm(fit.explanation, stack, kinds, fit.whitened[:, None])[0]
    null = _alarm(fit.explanation, stack, kinds, fit.explanation.draws(draws, fit.kappa, rng))
    return float((1 + np.sum(null >= own)) / (1 + len(null)))


def _alarm(explanation: Explanation, stack: Stack, kinds: Sequence[str], residuals: Floats) -> Floats:
    """Log Bayes factor (b,) of anything: mean over ways within kinds and over kinds."""
    from scipy.special import logsumexp

    none = explanation.log_none(residuals) + kappa_log_prior()[:, None]
    factors = StackEvidence(explanation, stack).log_factors(residuals)
    of_ways = logsumexp(none[:, None] + factors, axis=0) - logsumexp(none, axis=0)
    names = list(dict.fromkeys(kinds))
    of_kinds = [logsumexp(of_ways[[k == name for k in kinds]], axis=0) - np.log(kinds.count(name)) for name in names]
    return np.asarray(logsumexp(np.array(of_kinds), axis=0) - np.log(len(names)))


def with_smooth_changes(forward: Forward, fit: SpecimenFit) -> float:
    """Log evidence of a fit with any smooth change of the tests beside it."""
    # what a limit of a parameter costs, see `Fitting`, counts here too
    plain = float(fit.explanation.log_marginal(fit.whitened[:, None])[0])
    loose = [fit.explanation.with_more(smooth_patterns(forward.protocol, size)[fit.rows]) for size in SIZES]
    return float(log_unknown(loose, fit.whitened[:, None])[0]) + fit.log_evidence - plain
