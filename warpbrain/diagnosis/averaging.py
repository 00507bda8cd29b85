"""What is said of an effect of a fit: averaged over the scan, where the fit at its best place would be too sure."""

from __future__ import annotations

from warpbrain.diagnosis.refitting import Refit
from warpbrain.diagnosis.spectrum import amount_in_all
from warpbrain.diagnosis.stage import Stage
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.parameters import values_of
from warpbrain.worlds.body.values import Value


def averaged_values(stage: Stage, kind: str, fit: Refit, number: int) -> tuple[Value, ...]:
    """Parameters of an effect of a fit.

    Parameters
    ----------
    stage : Stage
        That screened the kind.
    kind : str
    fit : Refit
    number : int
        Of the effect in this fit.
    """
    effect = fit.effects[number]
    values = values_of(effect, fit.coefficients[number], fit.covariances[number])
    if effect.proposed.history is None:
        return values
    effects = [stage.candidates.effects[k] for k in stage.candidates.of_kind[kind].tolist()]
    amount, sd = amount_in_all(effects, fit, number, stage.explanation.factor)
    in_all = _in_all(effect)
    return tuple(Value(one.name, amount, sd, one.unit) if one.name == in_all else one for one in values)


def _in_all(effect: Effect) -> str:
    """Name of the parameter whose numbers add up."""
    parameters = effect.proposed.make(effect.proposed.mean).parameters()
    return next(name for name, says in parameters.items() if says.adds_up)
