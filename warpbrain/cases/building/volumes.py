"""Volumes that no brain and no body has: a mesh in the wrong unit.

Beside what else can go wrong, which processes read that are to load little.
"""

from __future__ import annotations

from warpbrain.cases.parts.anatomy import LARGEST_VOLUME, SMALLEST_VOLUME
from warpbrain.errors import InputError
from warpbrain.frame import METRES

#: Of what is labelled in a scan [m3]: from a small rodent's brain to a phantom larger than any head.
SMALLEST, LARGEST = 1e-6, 1e-2
_HINT = "are its lengths in millimetres?"


def check_volume(what: str, volume: float) -> None:
    """`InputError` if a volume [m3] is none that tissue of a brain can have."""
    if not SMALLEST <= volume <= LARGEST:
        raise InputError(f"{what} has a volume of {cm3(volume)}, expected {cm3(SMALLEST)} to {cm3(LARGEST)}: {_HINT}")


def check_volume_in(what: str, volume: float, unit: str) -> None:
    """`InputError` if a volume [m3], of lengths read in a unit of `METRES`, is no body's: says which unit would do."""
    if SMALLEST_VOLUME < volume < LARGEST_VOLUME:
        return
    for other, metres in METRES.items():
        meant = volume * (metres / METRES[unit]) ** 3
        if SMALLEST_VOLUME < meant < LARGEST_VOLUME:
            hint = f"in {other} it would be {cm3(meant)}: --units {other}"
            break
    else:
        hint = _HINT
    expected = f"{cm3(SMALLEST_VOLUME).removesuffix(' cm3')} to {cm3(LARGEST_VOLUME)}"
    raise InputError(f"{what} has a volume of {cm3(volume)} in {unit}, expected {expected}; {hint}")


def cm3(volume: float) -> str:
    """A volume [m3] as users read it."""
    return f"{volume * 1e6:.4g} cm3"
