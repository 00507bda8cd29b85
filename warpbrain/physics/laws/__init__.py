"""Material laws, one file each, and those that other packages add."""

from warpbrain.errors import InputError
from warpbrain.physics.laws.law import FORMULATIONS, Law, LawKey
from warpbrain.physics.laws.mooney_rivlin import MooneyRivlin
from warpbrain.physics.laws.neo_hookean import NeoHookean
from warpbrain.physics.laws.ogden import Ogden
from warpbrain.plugins import added_by_packages


def _with_added(laws: dict[str, type[Law]]) -> dict[str, type[Law]]:
    """Laws by name, with those that packages name by entry points `warpbrain.laws`."""
    added = added_by_packages("laws", laws)
    for name, law in added.items():
        if not (isinstance(law, type) and issubclass(law, Law) and law.name == name):
            raise InputError(f"entry point '{name}' of warpbrain.laws: expected a Law whose name is '{name}'")
    return laws | added


#: Laws by their name in `case.toml`.
LAWS: dict[str, type[Law]] = _with_added({law.name: law for law in (NeoHookean, MooneyRivlin, Ogden)})

__all__ = ["FORMULATIONS", "LAWS", "Law", "LawKey", "MooneyRivlin", "NeoHookean", "Ogden"]
