"""Case folders: what a user has. The package itself is a mapping of the shipped cases by name.

>>> import warpbrain as wb
>>> "0529" in wb.cases
True
>>> wb.cases["0529"].title
'Left temporal lobe resection, stand-in for clinical case 0529'
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import ModuleType
from typing import TYPE_CHECKING

from warpbrain.cases.shipped import SHIPPED, find_case

if TYPE_CHECKING:
    from warpbrain.cases.case import Case


class _Shipped(ModuleType):
    """This package, with the shipped cases in it; `find_case` reads those of one tissue, and a user's own."""

    def __getitem__(self, name: str) -> Case:
        if name not in SHIPPED:
            raise KeyError(f"'{name}' is no shipped case; there are: {', '.join(SHIPPED)}")
        return find_case(name)

    def __iter__(self) -> Iterator[str]:
        return iter(SHIPPED)

    def __len__(self) -> int:
        return len(SHIPPED)

    def __contains__(self, name: object) -> bool:
        return name in SHIPPED


sys.modules[__name__].__class__ = _Shipped
