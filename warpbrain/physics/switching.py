"""What a mechanism can be instead of what it is, where there is nothing in between: no derivative, but differences."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from warpbrain.physics.mechanism import Mechanism


def alternatives(mechanism: Mechanism) -> tuple[Mechanism | None, ...]:
    """The same mechanism with each other choice of a parameter that has choices, and None if it can be absent.

    A contact that is stuck can slide or lift off; a falx or a resection is there or not.
    """
    others: list[Mechanism | None] = [
        _with(mechanism, name, choice)
        for name, says in mechanism.parameters().items()
        for choice in says.choices
        if choice != getattr(mechanism, name)
    ]
    return (*others, None) if mechanism.switches else tuple(others)


def _with(mechanism: Mechanism, name: str, value: Any) -> Mechanism:
    values: dict[str, Any] = {name: value}
    return replace(mechanism, **values)
