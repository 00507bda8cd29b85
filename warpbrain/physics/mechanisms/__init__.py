"""The registry of mechanisms: every file in this folder that defines one, and what other packages add."""

import importlib
import inspect
import pkgutil
from functools import cache

from warpbrain.errors import InputError
from warpbrain.physics.mechanism import Mechanism
from warpbrain.plugins import added_by_packages


@cache
def mechanisms() -> dict[str, type[Mechanism]]:
    """Mechanisms by kind, in the order of their names; those of other packages by entry points `warpbrain.mechanisms`.

    `InputError` if another package names what is no mechanism, cannot be loaded, or has a name that is taken.
    """
    kinds: dict[str, type[Mechanism]] = {}
    for module in pkgutil.iter_modules(__path__, f"{__name__}."):
        for _, member in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            if issubclass(member, Mechanism) and member.__module__ == module.name and not inspect.isabstract(member):
                assert member.kind not in kinds, f"two mechanisms are called '{member.kind}'"
                kinds[member.kind] = member
    for name, added in added_by_packages("mechanisms", kinds).items():
        if not (inspect.isclass(added) and issubclass(added, Mechanism) and added.kind == name):
            raise InputError(f"entry point '{name}' of warpbrain.mechanisms: expected a Mechanism of kind '{name}'")
        kinds[name] = added
    return dict(sorted(kinds.items()))
