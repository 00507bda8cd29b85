"""What each pair of mechanisms means together: the total potential with both, as a formula, and what is refused."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.potential import PLACES, Enters


@dataclass(frozen=True)
class Pair:
    """What two kinds of mechanisms, or one twice, are together."""

    kinds: tuple[str, str]
    potential: str  # the total potential with both, as a formula; empty if a case cannot have both
    remark: str  # what the formula leaves open; empty if nothing
    refused: str  # where, or why, a case cannot have both; empty if it always can


def pairs() -> list[Pair]:
    """All pairs of the registry, each kind with itself too, in the order of their names."""
    kinds = mechanisms().values()
    return [_pair(kind, other) for kind, other in itertools.combinations_with_replacement(kinds, 2)]


def _pair(first: type[Mechanism], second: type[Mechanism]) -> Pair:
    kinds = (first.kind, second.kind)
    if first is second and not first.several:
        at_a_time = " at a time" if issubclass(first, Load) else ""
        turns = "; several take turns by their ramps" if at_a_time else ""
        words = f"a case has one {first.kind}{at_a_time}, a second one would act twice{turns}"
        return Pair(kinds, "", "", f"{words}; that of `--with` takes its place")
    remark = first.together.get(second.kind, "") or second.together.get(first.kind, "")
    refused = first.excluded(second) or second.excluded(first)
    return Pair(kinds, potential([first.enters, second.enters]), remark, refused)


def potential(entering: Sequence[Enters]) -> str:
    """The total potential with some mechanisms, as a formula."""
    symbols: dict[str, list[str]] = {place: [] for place in PLACES}
    names = [each.symbol for each in entering]
    for number, entry in enumerate(entering):
        twice = names.count(entry.symbol) > 1
        symbols[entry.place].append(f"{entry.symbol}_{number + 1}" if twice else entry.symbol)
    strain = "F_e" if symbols["growth"] else "F"
    law = f"Psi_({', '.join(symbols['law'])})" if symbols["law"] else "Psi"
    elastic = [f"{name}({strain})" for name in (law, *symbols["energy"])]
    tensions = [f"{name}({strain})" for name in symbols["tension"]]
    factors = " ".join(symbols["moduli"])
    if tensions and factors:
        elastic = [f"{factors} {_bracketed(elastic)}"]
        factors = ""
    outer = [*symbols["part"], *(f"(1 + {name})" for name in symbols["growth"]), *([factors] if factors else [])]
    over = "".join(f" without {name}" for name in symbols["body"])
    text = " ".join([f"sum{over} V", *outer, _bracketed([*elastic, *tensions])])
    filled = [each.fills for each in entering if each.fills]
    text += "".join(f" + {name}(u)" for name in (*filled, *symbols["beside"]))
    weights = [f"{' '.join([*symbols['part'], name])}" for name in symbols["weight"]]
    return text + "".join(f" - {name} . u" for name in (*symbols["load"], *weights))


def _bracketed(terms: Sequence[str]) -> str:
    return terms[0] if len(terms) == 1 else f"[{' + '.join(terms)}]"
