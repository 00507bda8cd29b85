"""How the shipped brain meshes were made: `build` makes them again, from the ICBM152 template maps.

Needs the extra ``warpbrain[build]``. Nothing here is imported when a simulation runs.
"""

from warpbrain.cases.building.errors import BuildError
from warpbrain.cases.building.pipeline import NAMES, build

__all__ = ["NAMES", "BuildError", "build"]
