"""What mechanisms mean together: the page of the rule, and the table of all pairs beside it."""

from __future__ import annotations

import csv
import io

from warpbrain.physics import potential
from warpbrain.physics.composition import pairs
from warpbrain.physics.mechanisms import mechanisms

_HEAD = """# Mechanisms together

Several mechanisms act together as one energy ([potential.py](../../warpbrain/physics/potential.py)), tabulated here by
`python docs/make_mechanisms.py`. `tests/physics/test_composition.py` checks every pair, and all at once, against that
energy in NumPy: forces and tangents in the second of two time steps, to 1e-9.
"""

_TABLE = """## All pairs

[pairs.csv](pairs.csv) has the total potential of each pair, and what is refused, with the reason: where a case is
read, where `--with` is given (exit status 2) and where a model is made, so in ensembles, estimates and diagnoses too.
`u` is the displacement, `V` the volume of an element, `sum` is over the elements.

```{csv-table}
:file: pairs.csv
:header-rows: 1
```
"""


def pairs_page() -> str:
    """The whole page."""
    lines = [_HEAD, f"```{{docstring}} {potential.__name__}", "```", "", "| place | mechanisms |", "|---|---|"]
    for place, meaning in potential.PLACES.items():
        there = [f"[{kind}]({kind}.md)" for kind, m in mechanisms().items() if m.enters.place == place]
        if there:
            lines.append(f"| {meaning} | {', '.join(there)} |")
    return "\n".join([*lines, "", _TABLE])


def pairs_table() -> str:
    """Every pair with what it means or why not, as CSV."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["first", "second", "total potential", "remarks"])
    for pair in pairs():
        formula = f"`{pair.potential}`" if pair.potential else ""
        refused = f"Refused {pair.refused}." if pair.potential else f"Refused: {pair.refused}."
        said = " ".join(filter(None, [pair.remark, refused if pair.refused else ""]))
        table.writerow([*pair.kinds, formula, said])
    return text.getvalue()
