"""What can go wrong while building meshes, and volumes that no brain has: in one line for the user."""

from __future__ import annotations

import importlib.util
from collections.abc import Collection

from warpbrain.errors import InputError
from warpbrain.frame import METRES


class BuildError(InputError):
    """A mesh could not be built; the message says why and what to do."""


def require_extra(modules: Collection[str] = ("mmgpy", "nilearn", "nibabel", "scipy", "meshio")) -> None:
    """Stop with a plain sentence if one of the packages that only building needs is missing."""
    missing = [module for module in modules if importlib.util.find_spec(module) is None]
    if missing:
        raise BuildError(
            f"building meshes needs {', '.join(missing)}, not installed here: pip install 'warpbrain[build]'. "
            "Running the shipped cases does not need it."
        )


#: From a small rodent's brain to a phantom larger than any head [m3].
SMALLEST, LARGEST = 1e-6, 1e-2
_HINT = "are its lengths in millimetres?"


def check_volume(what: str, volume: float) -> None:
    """`InputError` if a volume [m3] is none that tissue of a brain can have."""
    if not SMALLEST <= volume <= LARGEST:
        raise InputError(f"{what} has a volume of {cm3(volume)}, expected {cm3(SMALLEST)} to {cm3(LARGEST)}: {_HINT}")


def check_volume_in(what: str, volume: float, unit: str) -> None:
    """As `check_volume`, for lengths that were read in a unit of `METRES`: says which other unit would do."""
    if SMALLEST <= volume <= LARGEST:
        return
    for other, metres in METRES.items():
        meant = volume * (metres / METRES[unit]) ** 3
        if SMALLEST <= meant <= LARGEST:
            hint = f"in {other} it would be {cm3(meant)}: --units {other}"
            break
    else:
        hint = _HINT
    raise InputError(f"{what} has a volume of {cm3(volume)} in {unit}, expected 1 to 10000 cm3; {hint}")


def cm3(volume: float) -> str:
    """A volume [m3] as users read it."""
    return f"{volume * 1e6:.4g} cm3"
