"""What results have in common: they draw themselves, and a notebook shows them as a table."""

from typing import Any

import warpbrain


class Shown:
    """A result that `warpbrain.plot` can draw and `warpbrain.html` can tell."""

    def plot(self, **options: Any) -> Any:
        """Draw it with PyVista; options and what is returned are those of `warpbrain.plot`."""
        return warpbrain.plot(self, **options)

    def _repr_html_(self) -> str:
        """For notebooks."""
        return warpbrain.html(self)
