"""Labels: what is true of a case, sealed apart from its folder until the tool has spoken, and what it was made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from concealed.sealing import fingerprint, sealed, write_sealed
from referee import effects
from referee.effects import Effect
from referee.observe import seen
from referee.plan import Planned
from referee.setting import Setting
from referee.sizing import Sized
from referee.truth import Truth


def label_of(name: str, plan: Planned, truth: Truth, attempts: list[str]) -> dict[str, Any]:
    """Everything that is true of a case.

    Parameters
    ----------
    name : str
    plan : Planned
    truth : Truth
    attempts : list of str
        Why earlier draws of this case were given up.
    """
    fitted, checked = truth.sensors.fitted, truth.sensors.checked
    places, moved = truth.tracked(checked)
    clean = truth.effect(fitted)
    noise = seen(truth, checked, 2) - _registered(truth, checked)
    acting = []
    for one, given in zip(truth.found, truth.given, strict=True):
        stands = {"detectability": one.d, "conditional": given, "upper": one.upper, "wanted": one.wanted}
        numbers = {name: _number(value) for name, value in stands.items()}
        acting.append({**one.effect.described(), **numbers, "drawn_again": one.again, **_alone(truth, one)})
    return {
        "case": name,
        "kind": plan.kind,
        "names": list(plan.names),
        "effects": acting,
        "detectability": _number(truth.whole),
        "upper": _number(truth.upper),
        "rms_effect_m": _number(np.sqrt((clean**2).sum(axis=2).mean())),
        "rms_declared_m": _number(np.sqrt((truth.declared[fitted] ** 2).sum(axis=1).mean())),
        "setting": truth.setting.described(),
        "points_m": _array(truth.tracked(fitted)[0]),
        "clean_effect_m": _array(clean),
        "clean_effect_on_wall_m": _array(truth.effect_on_wall),
        "clean_effect_n": _array(truth.force - truth.held),
        "check_points_m": _array(places),
        "check_displacement_m": _array(moved),
        "check_noise_m": _number(np.sqrt((noise**2).sum(axis=2).mean())),
        "forces_left": _number(truth.left),
        "attempts": attempts,
    }


def _alone(truth: Truth, one: Sized) -> dict[str, Any]:
    """What one of several effects changes to first order of what is recorded, by the names that all together have."""
    if len(truth.found) < 2:
        return {}
    move = one.change.move[:, truth.sensors.fitted]
    times = max(1, len(truth.setting.times))
    return {
        "clean_effect_m": _array(np.repeat(move, times // len(move), axis=0)),
        "clean_effect_on_wall_m": _array(truth.sensors.on_wall(one.change.move[-1])),
        "clean_effect_n": _array(one.change.force),
    }


def _registered(truth: Truth, nodes: NDArray[np.int64]) -> NDArray[np.float64]:
    points = truth.setting.body.points
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    places, moved = truth.tracked(nodes)
    return np.stack([truth.setting.blur.misaligned(places, u, middle) for u in moved])


def _number(value: Any) -> float:
    return float(f"{float(value):.6g}")


def _array(values: NDArray[np.float64]) -> list[Any]:
    """To a tenth of a micrometre."""
    return np.round(values, 7).tolist()


def seal(folder: Path, label: dict[str, Any]) -> str:
    """Write a label, and return its hash."""
    data = sealed(label)
    write_sealed(folder / f"{label['case']}.json.gz", data)
    return fingerprint(data)


#: Classes of effects by the kind that a label tells.
_CLASSES: dict[str, type[Effect]] = {
    found.kind: found for name in effects.__all__ if name != "Effect" for found in [getattr(effects, name)]
}


def setting_of(label: Mapping[str, Any]) -> Setting:
    """The setting that a label tells."""
    return Setting(**{name: _plain(value) for name, value in label["setting"].items()})


def effects_of(label: Mapping[str, Any]) -> list[Effect]:
    """The effects that a label tells, at their size."""
    found = []
    for told in label["effects"]:
        kind = _CLASSES[told["kind"]]
        # what a label of an earlier run does not tell has the value that it had then
        found.append(kind(**{f.name: _plain(told[f.name]) for f in fields(kind) if f.name in told}))
    return found


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
