"""What other packages add to this one by entry points: mechanisms, laws, readers of recordings.

A package names them in its `pyproject.toml`, in tables of which `examples/package` shows all::

    [project.entry-points."warpbrain.mechanisms"]
    turning = "turning_heads:Turning"
"""

from importlib.metadata import entry_points
from typing import Any

from warpbrain.errors import InputError


def added_by_packages(group: str, known: dict[str, Any]) -> dict[str, Any]:
    """What installed packages add to a group, by the names that they give; the `known` ones cannot be taken.

    `InputError`, which tells which package, if what it names cannot be loaded, or its name is taken.
    """
    added: dict[str, Any] = {}
    for point in sorted(entry_points(group=f"warpbrain.{group}"), key=lambda point: point.name):
        package = point.dist.name if point.dist else "a package"
        place = f"{package}: entry point '{point.name}' of warpbrain.{group}"
        if point.name in known or point.name in added:
            raise InputError(f"{place}: the name is taken; expected another one")
        try:
            added[point.name] = point.load()
        except Exception as error:
            # whatever the other package does when it is imported
            raise InputError(f"{place}: cannot load {point.value}: {type(error).__name__}: {error}") from error
    return added
