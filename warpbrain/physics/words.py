"""Numbers and directions as people read them: a spread, a unit, left and right; no name of a parameter.

What a mechanism says of its own numbers is in its file (`size_in_words` of `warpbrain.physics.mechanism.Mechanism`);
where it says nothing of its own, `clauses` says what its parameters say of themselves.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats


@dataclass(frozen=True)
class Value:
    """A parameter of a mechanism after the fit."""

    name: str
    value: float  # in the unit
    sd: float
    unit: str


@dataclass(frozen=True)
class Smallest:
    """The smallest effect of a kind that these data show."""

    size: float  # in the unit: nine of ten raise an alarm
    unit: str
    name: str  # of the parameter
    named: float = float("inf")  # the size of which half would be named; infinite if none would
    plausible: bool = True  # whether an effect is looked for that is as large


@dataclass(frozen=True)
class Measurement:
    """Something that could be measured next."""

    what: str
    expected_nats: float  # by which it would tell the two most probable causes apart, expected log Bayes factor


if TYPE_CHECKING:
    from warpbrain.physics.mechanism import ParameterSpec

#: How labels begin that keep their capital.
_NAMES = ("Poisson", "Young's", "Ogden's")
#: Both ends of each axis (RAS).
_ENDS = (("left", "right"), ("posterior", "anterior"), ("inferior", "superior"))
#: What is said where a spread is larger than what it is the spread of.
HARDLY = "which these data hardly tell"

#: What was found of the parameters of a mechanism, by name.
Values = Mapping[str, Value]


def enumerated(words: Sequence[str]) -> str:
    """Words, at least one, with commas between them and "and" before the last."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


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


def tabled(value: float) -> str:
    """A number in a table, three decimals; three digits of what is smaller than 0.01, as lengths of specimens in mm."""
    return number(value, 3) if 0.0 < abs(value) < 0.01 else f"{value:.3f}"


def length(metres: float) -> str:
    """A length for people: hundredths of a millimetre, two digits of what is smaller, micrometres below 0.01 mm."""
    size = 1e3 * metres
    if size != 0.0 and abs(size) < 0.01:
        return f"{number(1e3 * size)} µm"
    return f"{size:z.2f} mm" if abs(size) >= 0.1 or size == 0.0 else f"{number(size)} mm"


def pascals(stress: float) -> str:
    """A stress [Pa] for people, with three digits that count."""
    return f"{number(1e-3 * stress, 3)} kPa" if abs(stress) >= 1000.0 else f"{stress:.3g} Pa"


def seconds(time: float) -> str:
    """A time [s] for people, three digits that count; whole seconds of what is longer."""
    return f"{time:.3g}" if abs(time) < 1000.0 else f"{time:.0f}"


def place(position: ArrayLike, extent: float) -> str:
    """A position (3,) [m] in millimetres, to a hundredth of an extent [m] or finer; whole ones from 1 cm up."""
    decimals = max(0, 1 - math.floor(math.log10(1e3 * extent)))
    return f"({', '.join(f'{1e3 * float(value):z.{decimals}f}' for value in np.ravel(position))}) mm"


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


def towards(direction: ArrayLike) -> str:
    """Where a direction (3,) in RAS points: the nearest of the axes and the halves between two of them.

    Of two the one that it points to more is said first; empty of a direction that is none.
    """
    ends = _nearest(np.asarray(direction, dtype=float))
    return f"towards {' and '.join(ends)}" if ends else ""


def along(direction: ArrayLike) -> str:
    """The line that a direction (3,) in RAS lies on: as `towards`, from one end of it to the other."""
    vector = np.asarray(direction, dtype=float)
    first, last = (" and ".join(_nearest(sign * vector)) for sign in (-1.0, 1.0))
    return f"from {first} to {last}" if last else ""


def _nearest(vector: Floats) -> list[str]:
    most, second = np.argsort(-np.abs(vector), kind="stable")[:2].tolist()
    size = abs(vector)
    if not size[most] > 0.0:
        return []
    # the cosine with the half between two axes against that with the axis itself
    count = 2 if (size[most] + size[second]) / math.sqrt(2.0) > size[most] else 1
    return [_ENDS[axis][int(vector[axis] > 0.0)] for axis in (most, second)[:count]]


def name_of_set(name: str) -> str:
    """The name of a set of a mesh in words, with spaces for hyphens and underscores."""
    return name.replace("-", " ").replace("_", " ")


def unsure(value: Value) -> bool:
    """Whether its spread is larger than itself, so that not even its sign is known."""
    return value.sd > abs(value.value)


def vector_in(values: Values, name: str) -> Floats:
    """Components (3,) of a parameter that is a vector; zero where nothing is known."""
    components = (values.get(f"{name}_{axis}") for axis in "xyz")
    return np.array([0.0 if component is None else component.value for component in components])


def clauses(parameters: Mapping[str, ParameterSpec], values: Values) -> list[str]:
    """Numbers as their parameters say what they are; places and directions are said elsewhere."""
    sentences = []
    if "share" in values and not any(spec.told for spec in parameters.values()):
        share = values["share"]
        sentences.append(f"it is there to {measured(100.0 * share.value, 100.0 * share.sd)} %")
    for name, value in values.items():
        spec = parameters.get(name)
        if spec is None or spec.kind not in ("number", "numbers"):
            continue
        clause = label(spec.doc)
        possessive = "" if "'" in clause.split(" ")[0] else "its "
        positive, *others = spec.told or (f"{possessive}{clause} is {{}}",)
        size = value.value
        if others and unsure(value):
            positive = f"{others[1]}, {HARDLY}"
        elif others:
            positive, size = positive if size >= 0.0 else others[0], abs(size)
        sentences.append(positive.format(measured(size, value.sd, value.unit)))
    return sentences


def label(doc: str) -> str:
    """What a parameter is, from the first clause of what it says of itself that is more than a symbol."""
    parts = [clause.strip() for clause in re.split("[;:,]", doc.rstrip("."))]
    clause = next((clause for clause in parts if len(clause) > 3), parts[0])
    return clause if clause.startswith(_NAMES) else clause[0].lower() + clause[1:]
