"""Sizes of mechanisms in words, whatever their kind; what is particular to one is said in its file."""

import math
from collections.abc import Sequence

from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.words import Smallest, Value, measured, number

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
    farthest = _WHOLE if smallest.name == "share" else math.inf
    if not math.isfinite(size) or size > farthest or not smallest.plausible:
        return "would not have been seen, whatever its size"
    if smallest.name == "share":
        return f"from {number(100.0 * size)} % of its full size"
    if kind not in mechanisms():
        return f"from {smallest.name} {number(size)} {smallest.unit}".rstrip()
    return mechanisms()[kind].smallest_in_words(smallest)


def beyond_in_words(kind: str, value: Value) -> str:
    """Which range a number is out of that its parameter has, by its limits or what is expected alike; empty if none."""
    spec = mechanisms()[kind].parameters().get(value.name) if kind in mechanisms() else None
    if spec is None or spec.kind != "number":
        return ""
    low, high = spec.above, spec.below
    if spec.expectation is not None and not spec.expectation.is_normal:
        low, high = spec.expectation.ends
    if low <= value.value <= high:
        return ""
    span = f"above {low:g}" if high == math.inf else f"below {high:g}" if low == -math.inf else f"{low:g} to {high:g}"
    return f"{value.name} would not be {span} {spec.unit}".rstrip()
