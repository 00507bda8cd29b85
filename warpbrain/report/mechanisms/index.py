"""The page that leads to those of the mechanisms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from warpbrain.physics.mechanisms import mechanisms
from warpbrain.report.mechanisms.cost import Costs, machine, ratio, reasons, row_of
from warpbrain.report.mechanisms.effect import Effect

_HEAD = """# Mechanisms

What can act on a brain beside its tissue's law. A case assumes one in `case.toml`, a run by `--with`; several act
together, as [one energy](pairs.md):

```toml
[[mechanism]]
kind = "gravity"
csf_level = 60.0
```

```sh
warpbrain run --case 0529 --with gravity:level=60 --with swelling:amount=-3
```

Each also takes `ramp = [[time, factor], ...]`, which scales what it does over time (s). Each is one file of
[physics/mechanisms](../../warpbrain/physics/mechanisms), from which `python docs/make_mechanisms.py` makes these
pages; below their pictures stand their equations.
"""

_EFFECT = """The effect is the largest on a displacement of the phantom under a light load
(`--case phantom-loaded`), by the example of each page: it does not say what matters more in a patient. Where a
page does not say what tells a mechanism apart from what it is taken for, one deformed state does. The cost is that of a
time step beside one without it, {where}.
"""

_COST = """## Cost

Each example on `phantom-loaded` (coarse mesh, grey and white matter), times the plain model, by `python -m
warpbrain.bench mechanisms --out bench/results`: a time step of 1 ms, and an iteration of Newton's method. *Plain beside
plain* says how far to trust the others. What is off costs nothing ([benchmarks.md](../benchmarks.md)).
"""

_TABLE = """[cost.csv](cost.csv):

```{csv-table}
:file: cost.csv
:header-rows: 1
```
"""


def index(effects: Mapping[str, Effect], measured: Sequence[Costs]) -> str:
    """The whole page.

    Parameters
    ----------
    effects : mapping of kind to Effect
    measured : sequence of Costs
        The first is in the overview.
    """
    where = f"on {machine(measured[0])}" if measured else "nowhere yet"
    lines = [_HEAD, "| | | effect | taken for | cost |", "|---|---|---|---|---|"]
    for kind, mechanism in mechanisms().items():
        row = row_of(measured[0], kind) if measured else None
        cost = "" if row is None else f"{ratio(row['step']):.2f}"
        cells = [
            f"[{kind}]({kind}.md)",
            mechanism.sentence,
            f"{effects[kind].largest:.2f} mm",
            ", ".join(mechanism.confused_with),
            cost,
        ]
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", _EFFECT.format(where=where), _COST]
    return "\n".join([*lines, *reasons(measured), "", _TABLE])
