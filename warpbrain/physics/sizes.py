"""Sizes of mechanisms in words, whatever their kind; what is particular to one is said in its file."""

from __future__ import annotations

import math
from collections.abc import Sequence

from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.words import Smallest, Value, measured, number

#: An effect that is seen only this improbably far out of what is expected [part] is no effect that is seen.
_FAR = 1e-4
#: How many times as large as it can be nothing is.
_WHOLE = 3.0


def size_in_words(
    kind: str, values: Sequence[Value], gravity_axis: tuple[float, float, float] | None = None
) -> tuple[str, ...]:
    """What was found of a mechanism, one clause for each thing that can be known; none of a switch.

    A kind that is not in the registry has the names of its numbers for words. A tilt is counted from `gravity_axis`,
    where 'down' was said to be.
    """
    by_name = {value.name: value for value in values if math.isfinite(value.value)}
    if kind not in mechanisms():
        return tuple(f"{name} {measured(value.value, value.sd, value.unit)}" for name, value in by_name.items())
    return tuple(mechanisms()[kind].size_in_words(by_name, gravity_axis))


def smallest_in_words(kind: str, smallest: Smallest) -> str:
    """The smallest effect that would have been seen; that it would not, if only an implausible one would."""
    size = smallest.size
    if smallest.unit == "of being there":
        return "would have been seen" if size <= 1.0 else "would not have been seen"
    if not math.isfinite(size) or _implausible(kind, smallest):
        return "would not have been seen, whatever its size"
    if smallest.name == "share":
        return f"from {number(100.0 * size)} % of its full size"
    if kind not in mechanisms():
        return f"from {smallest.name} {number(size)} {smallest.unit}".rstrip()
    return mechanisms()[kind].smallest_in_words(smallest)


def _implausible(kind: str, smallest: Smallest) -> bool:
    """Whether hardly any effect of a kind is so large."""
    name = smallest.name
    if name == "share":
        return smallest.size > _WHOLE
    stem = name[:-2] if name[-2:] in ("_x", "_y", "_z") else name.removesuffix("_size")
    says = mechanisms()[kind].parameters().get(stem) if kind in mechanisms() else None
    if says is None or says.expectation is None:
        return False
    low, middle, high = (says.expectation.quantile(part) for part in (_FAR, 0.5, 1.0 - _FAR))
    return smallest.size >= max(high - middle, middle - low)
