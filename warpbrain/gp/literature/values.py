"""Values in a file of studies, one at a time: what they may be, and what is wrong with one that is not."""

from __future__ import annotations

import math
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

from warpbrain.gp.literature.conventions import Parameter
from warpbrain.values import finite, short


def nearest(name: Any, names: Iterable[str]) -> str:
    """The cure for a name that is not known: the one that is probably meant, or all of them."""
    known = list(names)
    plain = {candidate.lower(): candidate for candidate in known}
    word = str(name).lower().replace("_", "-")
    near = get_close_matches(word, list(plain), n=1) or get_close_matches(word.replace("-", " "), list(plain), n=1)
    return f"did you mean '{plain[near[0]]}'?" if near else f"expected one of {', '.join(known)}"


def fault(key: Parameter, value: Any) -> str:
    """What is wrong with a parameter, in words; empty if nothing is."""
    unit = f" [{key.unit}]" if key.unit else ""
    items = value if key.several and isinstance(value, list) else [value]
    if not items or not all(finite(item) for item in items):
        expected = "a finite number or a list of them" if key.several else "a finite number"
        return f"found {short(value)}, expected {expected}{unit}"
    for item in items:
        if not key.zero and item == 0:
            return f"found {short(value)}, expected no 0"
        if not key.above < item < key.below:
            if math.isinf(key.below):
                return f"found {item:g}, expected a number above {key.above:g}{unit}"
            return f"found {item:g}, expected a number in the open interval ({key.above:g}, {key.below:g}){unit}"
    return ""
