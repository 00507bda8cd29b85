"""Material laws, one file each, and those that other packages add."""

from warpbrain.errors import InputError
from warpbrain.physics.laws.law import FORMULATIONS, Law, LawKey
from warpbrain.physics.laws.mooney_rivlin import MooneyRivlin
from warpbrain.physics.laws.neo_hookean import NeoHookean
from warpbrain.physics.laws.ogden import Ogden
from warpbrain.plugins import added_by_packages

#: Laws by their name in `case.toml`, with those that packages name by entry points `warpbrain.laws`.
LAWS: dict[str, type[Law]] = {law.name: law for law in (NeoHookean, MooneyRivlin, Ogden)}
for _name, _law in added_by_packages("laws", LAWS).items():
    if not (isinstance(_law, type) and issubclass(_law, Law) and _law.name == _name):
        raise InputError(f"entry point '{_name}' of warpbrain.laws: expected a Law whose name is '{_name}'")
    LAWS[_name] = _law

__all__ = ["FORMULATIONS", "LAWS", "Law", "LawKey", "MooneyRivlin", "NeoHookean", "Ogden"]
