"""Settings and effects of a label, as they were when it was made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from referee import effects
from referee.effects import Effect
from referee.setting import Setting

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
