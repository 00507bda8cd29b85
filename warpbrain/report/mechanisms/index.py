"""The page that leads to those of the mechanisms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from warpbrain.physics.mechanisms import mechanisms
from warpbrain.report.mechanisms.cost import Costs, machine, ratio, reasons, row_of, table
from warpbrain.report.mechanisms.effect import Effect

_HEAD = """# Mechanisms

What can act on a brain beside its tissue's own law. A case assumes one by a table of `case.toml`, a run by `--with`,
and several act together, as [one energy](pairs.md):

```toml
[[mechanism]]
kind = "gravity"
csf_level = 60.0
```

```sh
warpbrain run --case 0529 --with gravity:level=60 --with swelling:amount=-3
```

Each is one file of [physics/mechanisms](../../warpbrain/physics/mechanisms); these pages are made from the files by
`python docs/make_mechanisms.py`. How states and motions are differentiated by their numbers:
[solvers.md](../solvers.md#derivatives).
"""

_EFFECT = """The effect is the largest that its example has on a displacement of the phantom under a light load,
`--case phantom-loaded`. Examples are there to be seen: they do not say what matters more in a patient. The cost is that
of a time step with it beside one without it, as measured {where}.
"""

_COST = """## Cost

Each mechanism's example on `phantom-loaded` (coarse mesh, grey and white matter), times that of the plain model:

    python -m warpbrain.bench mechanisms --out bench/results

A time step is 1 ms, linearised, conjugate gradients to 1e-6; an iteration of Newton's method is that of an equilibrium,
its line search included. Steps with and without take turns in one process, in processor time on a CPU. Each number is
the median of the ratios of neighbours in time; that of the plain model beside itself says how far to trust the others.
A mechanism that makes the matrix worse conditioned, as a stiff membrane does, costs iterations of conjugate gradients,
which is in these numbers; where fluid flows MINRES takes their place, for displacement and pressure together
([solvers.md](../solvers.md#linear-systems)).

What is off is not there: a model without mechanisms has no terms to sum, and each phase of its step takes as long as
before there were mechanisms ([benchmarks.md](../benchmarks.md)).
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
    lines = [_HEAD, "| | | effect | taken for | told apart by | cost |", "|---|---|---|---|---|---|"]
    for kind, mechanism in mechanisms().items():
        row = row_of(measured[0], kind) if measured else None
        cost = "" if row is None else f"{ratio(row['step']):.2f}"
        cells = [
            f"[{kind}]({kind}.md)",
            mechanism.sentence,
            f"{effects[kind].largest:.2f} mm",
            ", ".join(mechanism.confused_with),
            ", ".join(mechanism.needs),
            cost,
        ]
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", _EFFECT.format(where=where), _COST, *table(measured, list(mechanisms())), ""]
    long = reasons(measured)
    return "\n".join([*lines, *(["What makes steps long:", "", *long, ""] if long else [])])
