"""Sizes of mechanisms in words and units that a surgeon uses; the name of a parameter is never one of them.

Kinds whose numbers read better in a phrase of their own have one here. All others are said by what their parameters say
of themselves (`warpbrain.physics.mechanism.Says`), so that a new mechanism needs no line in this file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence

import numpy as np

from warpbrain.physics.mechanisms import mechanisms
from warpbrain.worlds.body.values import Smallest, Value

#: How labels begin that keep their capital.
_NAMES = ("Poisson", "Young's", "Ogden's")
#: Values by name, as a phrase gets them.
Values = dict[str, Value]
#: An effect that is seen only this improbably far out of what is expected [part] is no effect that is seen.
_FAR = 1e-4


def number(value: float, digits: int = 2) -> str:
    """A number with so many digits that count, without an exponent."""
    if not math.isfinite(value):
        return "an unknown number"
    if value == 0.0:
        return "0"
    if abs(value) < 1e-4:
        return f"{value:.{digits - 1}e}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:z.{decimals}f}"


def measured(value: float, sd: float, unit: str = "") -> str:
    """A number, its standard deviation and its unit: as many digits as the deviation allows."""
    if unit == "Pa" and abs(value) >= 1000.0:
        value, sd, unit = 1e-3 * value, 1e-3 * sd, "kPa"
    if not (math.isfinite(sd) and sd > 0.0):
        text = number(value, 3)
    elif max(abs(value), sd) < 1e-4:
        text = f"{value:.1e} ± {sd:.0e}"
    else:
        first = math.floor(math.log10(sd))
        decimals = max(0, -first + (1 if sd / 10.0**first < 2.95 else 0))
        text = f"{value:z.{decimals}f} ± {sd:.{decimals}f}"
    return f"{text} {unit}".rstrip()


def size_in_words(
    kind: str, values: Sequence[Value], gravity_axis: tuple[float, float, float] | None = None
) -> tuple[str, ...]:
    """What was found of a mechanism, one clause for each thing that can be known; none of a switch.

    Parameters
    ----------
    kind : str
    values : sequence of Value
    gravity_axis : (float, float, float), optional
        Where 'down' was said to be: what a tilt is counted from.
    """
    by_name = {value.name: value for value in values if math.isfinite(value.value)}
    if kind == "gravity":
        return _gravity(by_name, gravity_axis)
    if kind in _PHRASES:
        return tuple(_PHRASES[kind](by_name))
    return tuple(_others(kind, by_name))


def smallest_in_words(kind: str, smallest: Smallest) -> str:
    """The smallest effect that would have been seen; that it would not, if only an implausible one would."""
    size = smallest.size
    if smallest.unit == "of being there":
        return "would have been seen" if size <= 1.0 else "would not have been seen"
    if not math.isfinite(size) or _implausible(kind, smallest):
        return "would not have been seen, whatever its size"
    if smallest.name == "share":
        return f"from {number(100.0 * size)} % of its full size"
    if kind == "inclusion":
        return f"from {number(1.0 + size)} times the stiffness around it"
    if kind == "viscoelasticity":
        return f"from a tissue that at first is {number(1.0 + size)} times as stiff as in the end"
    if smallest.unit == "Pa" and size >= 1000.0:
        return f"from {number(1e-3 * size)} kPa"
    if smallest.unit:
        return f"from {number(size)} {smallest.unit}"
    return f"from a change of {number(size)} in {_label(kind, smallest.name)}"


def _gravity(values: Values, axis: tuple[float, float, float] | None) -> tuple[str, ...]:
    found = []
    if "csf_level" in values:
        level = values["csf_level"]
        found.append(
            f"the fluid's surface is {measured(level.value, level.sd, 'mm')} above the lowest point of the anatomy"
        )
    if "share" in values:
        share = values["share"]
        found.append(f"{measured(100.0 * share.value, 100.0 * share.sd)} % of that weight acts")
    components = [values.get(f"direction_{letter}") for letter in "xyz"]
    if axis is not None and any(components):
        down = np.array(axis) / np.linalg.norm(axis)
        # a component that is not known better than beforehand is where it was
        pairs = zip(components, down.tolist(), strict=True)
        found_down = np.array([before if one is None else one.value for one, before in pairs])
        across = np.linalg.norm(found_down - (found_down @ down) * down)
        tilt = math.degrees(math.atan2(float(across), float(found_down @ down)))
        spread = math.degrees(math.hypot(*(one.sd for one in components if one is not None)))
        found.append(f"'down' is tilted by {measured(tilt, spread)} degrees from what was declared")
    return tuple(found)


def _swelling(values: Values) -> list[str]:
    if "amount" not in values:
        return []
    amount = values["amount"]
    word = "swells" if amount.value >= 0.0 else "shrinks"
    return [f"it {word} by {measured(abs(amount.value), amount.sd, '%')} of its volume"]


def _inclusion(values: Values) -> list[str]:
    found = []
    if "ratio" in values and values["ratio"].value > 0.0:
        ratio = values["ratio"]
        if ratio.value >= 1.0:
            found.append(f"it is {measured(ratio.value, ratio.sd)} times as stiff as the tissue around")
        else:
            times = 1.0 / ratio.value
            spread = times * ratio.sd / ratio.value
            found.append(f"it is {measured(times, spread)} times as soft as the tissue around")
    return found + _radius(values)


def _radius(values: Values) -> list[str]:
    if "radius" not in values:
        return []
    return [f"its radius is {measured(values['radius'].value, values['radius'].sd, 'mm')}"]


def _contact(values: Values) -> list[str]:
    if "radius" not in values:
        return []
    return [f"what lets go has a radius of {measured(values['radius'].value, values['radius'].sd, 'mm')}"]


def _viscoelasticity(values: Values) -> list[str]:
    found = []
    if "moduli" in values:
        moduli = values["moduli"]
        found.append(
            f"at first it is {measured(1.0 + moduli.value, moduli.sd)} times as stiff as in the end, whether it "
            "relaxes in one time or in two; what relaxes before the first recording is hardly seen"
        )
    if "times" in values:
        of = "of " if values["times"].sd > values["times"].value else ""
        found.append(f"if it has one, its relaxation time is {of}{_time(values['times'])}")
    branches = [(values.get(f"moduli_{number}"), values.get(f"times_{number}")) for number in (1, 2)]
    each = [
        f"{measured(modulus.value, modulus.sd)} within {_time(time)}"
        for modulus, time in branches
        if modulus is not None and time is not None
    ]
    if each:
        found.append(f"if it has two, what relaxes, as a part of that in the end, is {', and '.join(each)}")
    return found


def _time(value: Value) -> str:
    if value.sd > value.value:
        # a number with a spread beyond itself would look like a mistake
        return f"the order of {number(value.value, 1)} {value.unit}, which these data hardly tell"
    return measured(value.value, value.sd, value.unit)


def _pressure(values: Values) -> list[str]:
    if "value" not in values:
        return []
    pressure = values["value"]
    word = "higher" if pressure.value >= 0.0 else "lower"
    return [f"it is {measured(abs(pressure.value), pressure.sd, 'Pa')} {word} there than elsewhere"]


def _traction(values: Values) -> list[str]:
    if "value_size" not in values:
        return _radius(values)
    size = values["value_size"]
    return [f"it acts with {measured(size.value, size.sd, 'Pa')}", *_radius(values)]


def _fibres(values: Values) -> list[str]:
    found = []
    for name, words, unit in (
        ("stiffness", "their stiffness is", "Pa"),
        ("exponent", "the exponent with which they stiffen is", ""),
        ("dispersion", "their scatter, from 0 all parallel to 1/3 no direction, is", ""),
    ):
        if name in values:
            found.append(f"{words} {measured(values[name].value, values[name].sd, unit)}")
    return found


_PHRASES: dict[str, Callable[[Values], list[str]]] = {
    "swelling": lambda values: _swelling(values) + _radius(values),
    "inclusion": _inclusion,
    "contact": _contact,
    "fibres": _fibres,
    "viscoelasticity": _viscoelasticity,
    "pressure": _pressure,
    "traction": _traction,
}


def _others(kind: str, values: Values) -> list[str]:
    """Numbers as their parameters say what they are; places and directions are said elsewhere."""
    found = []
    if "share" in values:
        share = values["share"]
        found.append(f"it is there to {measured(100.0 * share.value, 100.0 * share.sd)} %")
    known = mechanisms()[kind].parameters() if kind in mechanisms() else {}
    for name, value in values.items():
        if name in known and known[name].kind in ("number", "numbers"):
            label = _label(kind, name)
            whose = "" if "'" in label.split(" ")[0] else "its "
            found.append(f"{whose}{label} is {measured(value.value, value.sd, value.unit)}")
    return found


def _label(kind: str, name: str) -> str:
    """What a parameter is, from the first clause of what it says of itself that is more than a symbol."""
    doc = mechanisms()[kind].parameters()[name.removesuffix("_size")].doc
    clauses = [clause.strip() for clause in re.split("[;:,]", doc.rstrip("."))]
    clause = next((clause for clause in clauses if len(clause) > 3), clauses[0])
    return clause if clause.startswith(_NAMES) else clause[0].lower() + clause[1:]


def _implausible(kind: str, smallest: Smallest) -> bool:
    """Whether hardly any effect of a kind is so large."""
    name = smallest.name
    if name == "share":
        return smallest.size > 3.0
    stem = name[:-2] if name[-2:] in ("_x", "_y", "_z") else name.removesuffix("_size")
    says = mechanisms()[kind].parameters().get(stem) if kind in mechanisms() else None
    if says is None or says.expectation is None:
        return False
    low, middle, high = (says.expectation.quantile(part) for part in (_FAR, 0.5, 1.0 - _FAR))
    return smallest.size >= max(high - middle, middle - low)
