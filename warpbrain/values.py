"""Values of TOML files: which of them are numbers, and how a message shows them."""

from __future__ import annotations

import math
from typing import Any


def finite(value: Any) -> bool:
    """Whether it is a number of TOML that a float can hold (its integers may have any number of digits)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def short(value: Any) -> str:
    """A value as an error message shows it, on one line of a length that can be read."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."
