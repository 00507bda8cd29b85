"""Material laws, one file each."""

from warpbrain.physics.laws.law import FORMULATIONS, Law
from warpbrain.physics.laws.mooney_rivlin import MooneyRivlin
from warpbrain.physics.laws.neo_hookean import NeoHookean
from warpbrain.physics.laws.ogden import Ogden

#: Laws by their name in `case.toml`.
LAWS: dict[str, type[Law]] = {law.name: law for law in (NeoHookean, MooneyRivlin, Ogden)}

__all__ = ["FORMULATIONS", "LAWS", "Law", "MooneyRivlin", "NeoHookean", "Ogden"]
