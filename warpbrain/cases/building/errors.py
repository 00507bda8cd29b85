"""What can go wrong while building meshes, in one line for the user."""

from __future__ import annotations

import importlib.util
from collections.abc import Collection

from warpbrain.errors import InputError


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
