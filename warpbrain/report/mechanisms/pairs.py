"""The page of what mechanisms mean together: one table of all pairs."""

from __future__ import annotations

import inspect

from warpbrain.physics import potential
from warpbrain.physics.composition import pairs
from warpbrain.physics.mechanisms import mechanisms

_HEAD = """# Mechanisms together

Several mechanisms act together as one energy. This page is made from the code by `python docs/make_mechanisms.py`;
`tests/physics/test_composition.py` takes every pair of it, and all at once, against that energy in NumPy: forces and
tangents in the second of two time steps, to 1e-9.
"""

_TABLE = """## All pairs

`u` is the displacement, `V` the volume of an element, `sum` is over the elements. What a formula leaves open is said
beside it. What is refused is refused where a case is read, where `--with` is given (exit status 2) and where a model is
made, so in ensembles, estimates and diagnoses too: a diagnosis does not try what has no meaning together with what the
case assumes.
"""


def pairs_page() -> str:
    """The whole page."""
    rule = inspect.cleandoc(potential.__doc__ or "").split("\n\n", 1)[1]
    lines = [_HEAD, "## The rule", "", rule, "", "| place | mechanisms |", "|---|---|"]
    for place, meaning in potential.PLACES.items():
        there = [f"[{kind}]({kind}.md)" for kind, m in mechanisms().items() if m.enters.place == place]
        if there:
            lines.append(f"| {meaning} | {', '.join(there)} |")
    lines += ["", _TABLE, "| | | total potential | |", "|---|---|---|---|"]
    for pair in pairs():
        first, second = (f"[{kind}]({kind}.md)" for kind in pair.kinds)
        formula = f"`{pair.potential}`" if pair.potential else ""
        refused = f"Refused {pair.refused}." if pair.potential else f"Refused: {pair.refused}."
        said = " ".join(filter(None, [pair.remark, refused if pair.refused else ""]))
        lines.append(f"| {first} | {second} | {formula} | {said} |")
    return "\n".join([*lines, ""])
