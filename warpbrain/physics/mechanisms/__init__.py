"""The registry of mechanisms: every file in this folder that defines one."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from functools import cache

from warpbrain.physics.mechanism import Mechanism


@cache
def mechanisms() -> dict[str, type[Mechanism]]:
    """Mechanisms by kind, in the order of their names."""
    found: dict[str, type[Mechanism]] = {}
    for module in pkgutil.iter_modules(__path__, f"{__name__}."):
        for _, member in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            if issubclass(member, Mechanism) and member.__module__ == module.name and not inspect.isabstract(member):
                assert member.kind not in found, f"two mechanisms are called '{member.kind}'"
                found[member.kind] = member
    return dict(sorted(found.items()))
