"""The pages of docs/mechanisms, from the registry and from what was measured: they say what the code does."""

from __future__ import annotations

import csv
import hashlib
import inspect
import io
import json
import statistics
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import mechanism_picture
from mechanism_pairs import pairs
from mechanism_picture import MAGNIFIED, PLACE

from warpbrain.atomic import whole_file
from warpbrain.bench.mechanisms import BASE, PLAIN, ratio
from warpbrain.physics import potential
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import NUMBERS, Following, Mechanism
from warpbrain.physics.mechanisms import mechanisms

# what mechanisms cost, from the files that `python -m warpbrain.bench mechanisms` wrote ----------------------

#: How many times as long as a plain step is called long, and a plain iteration of the linear solver.
_LONG, _HARD = 3.0, 1.5
Costs = Mapping[str, Any]


def read_costs(paths: Iterable[Path]) -> list[Costs]:
    """Measurements, one a file."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths]


def _where(costs: Costs) -> str:
    """Where and when costs were measured."""
    return f"{costs['device']}, {costs['date']}"


def row_of(costs: Costs, kind: str) -> Mapping[str, Any] | None:
    """What was measured of a mechanism; None if nothing was."""
    return next((row for row in costs["rows"] if row["kind"] == kind), None)


def reasons(measured: Sequence[Costs]) -> list[str]:
    """Why steps with some mechanisms take long, a line a machine and mechanism; none if none does."""
    lines = []
    for costs in measured:
        for row in costs["rows"]:
            longer = ratio(row["step"])
            if longer < _LONG:
                continue
            plain, taken = (statistics.median(row["cg_iterations"][side]) for side in ("plain", "with"))
            known = mechanisms().get(row["kind"])
            # what was measured, where that is not the mechanism's present example
            other = f" (`{row['example']}`)" if known is not None and row["example"] != known.example else ""
            line = f"- {row['kind']}, {_where(costs)}{other}: {longer:.1f} times. "
            line += f"The linear solver takes {taken:g} iterations for {plain:g}"
            each = longer * plain / taken
            lines.append(line + (f", and {each:.1f} times as long for each." if each > _HARD else "."))
    return lines


def table(measured: Sequence[Costs], kinds: Sequence[str]) -> list[str]:
    """All mechanisms and the plain model beside itself, two columns a machine, as CSV."""
    heads = [f"{_where(costs)}: {what}" for costs in measured for what in ("step", "Newton iteration")]
    lines = [",".join(["", *(f'"{head}"' for head in heads)])]
    for kind in (PLAIN, *kinds):
        cells = []
        for costs in measured:
            row = row_of(costs, kind)
            cells += ["", ""] if row is None else [f"{ratio(row[what]):.2f}" for what in ("step", "newton")]
        lines.append(",".join([f"{PLAIN} beside {PLAIN}" if kind == PLAIN else kind, *cells]))
    return lines


# what their examples do to the phantom ---------------------------------------------------------------------

#: The files of the case that examples are said of.
_FILES = ("case-loaded.toml", "multi-loaded.vtu")


@dataclass(frozen=True)
class Effect:
    """What the example of a mechanism does to the phantom: the largest difference that it makes to a displacement [mm],
    where in the undeformed phantom [mm], and after how many steps of 1 ms from rest (0: in equilibrium)."""

    largest: float
    place: tuple[float, float, float]
    steps: int
    #: Digests: of the mechanism's file, its example, the phantom and the file that draws; and of the picture.
    made_from: str
    picture: str

    @property
    def command(self) -> str:
        """Arguments of the run that are not those of the mechanism."""
        return f"--case {BASE}" + (f" --steps {self.steps}" if self.steps else "")


def made_from(kind: str) -> str:
    """Digest of everything that a picture of a mechanism should be made again for."""
    mechanism = mechanisms()[kind]
    digest = hashlib.sha256(mechanism.example.encode())
    for module in (sys.modules[mechanism.__module__], mechanism_picture):
        digest.update(inspect.getsource(module).encode())
    for name in _FILES:
        digest.update((files("warpbrain.cases") / "data" / "phantom" / name).read_bytes())
    return digest.hexdigest()


def digest_of(path: Path) -> str:
    """Of a file; empty if there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""


def read_effects(path: Path) -> dict[str, Effect]:
    """Effects by kind of mechanism; none if there is no such file."""
    if not path.exists():
        return {}
    found = json.loads(path.read_text(encoding="utf-8"))
    return {kind: Effect(**{**values, "place": tuple(values["place"])}) for kind, values in found.items()}


def write_effects(path: Path, effects: Mapping[str, Effect]) -> None:
    """Write effects, in the order of the registry."""
    found = {kind: asdict(effects[kind]) for kind in mechanisms() if kind in effects}
    with whole_file(path) as scratch:
        scratch.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


# the page that leads to those of the mechanisms --------------------------------------------------------------

_INDEX_HEAD = """# Mechanisms

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

_COST_TABLE = """[cost.csv](cost.csv):

```{csv-table}
:file: cost.csv
:header-rows: 1
```
"""


def index(effects: Mapping[str, Effect], measured: Sequence[Costs]) -> str:
    """The whole page; the first of what was measured is in the overview."""
    where = f"on {_where(measured[0])}" if measured else "nowhere yet"
    lines = [_INDEX_HEAD, "| | | effect | taken for | cost |", "|---|---|---|---|---|"]
    for kind, mechanism in mechanisms().items():
        row = row_of(measured[0], kind) if measured else None
        cost = "" if row is None else f"{ratio(row['step']):.2f}"
        effect, others = f"{effects[kind].largest:.2f} mm", ", ".join(mechanism.confused_with)
        lines.append(f"| [{kind}]({kind}.md) | {mechanism.sentence} | {effect} | {others} | {cost} |")
    lines += ["", _EFFECT.format(where=where), _COST]
    return "\n".join([*lines, *reasons(measured), "", _COST_TABLE])


# the page of a mechanism ---------------------------------------------------------------------------------------


def page(kind: str, effect: Effect) -> str:
    """The whole page; the effect is that of its example."""
    mechanism = mechanisms()[kind]
    module = sys.modules[mechanism.__module__]
    source = f"../../{module.__name__.replace('.', '/')}.py"
    doc = (module.__doc__ or "").strip().splitlines()
    lines = [f"# {kind}", "", f"*{mechanism.sentence}* {doc[0]}", "", *_parameters(mechanism), ""]
    lines += [*_picture(mechanism, effect), "", *confusions(mechanism), *derivatives(mechanism), ""]
    lines += [f"[{source.rsplit('/', 1)[1]}]({source}), [cost](index.md#cost), [together with others](pairs.md)", ""]
    if len(doc) > 1:
        # the equations stand once, at the head of the file that computes them
        lines += [f"```{{docstring}} {module.__name__}", "```", ""]
    return "\n".join(lines)


def confusions(mechanism: type[Mechanism]) -> list[str]:
    """What has nearly the same effect, and what tells them apart."""
    known = mechanisms()
    others = [f"[{kind}]({kind}.md)" if kind in known else kind for kind in mechanism.confused_with]
    lines = [f"Taken for {', '.join(others)}." if others else "Nothing else has nearly the same effect."]
    if mechanism.of_specimens:
        lines.append("It acts in specimens too.")
    if issubclass(mechanism, Load | Following) and not mechanism.quadratic:
        lines.append("It does not act on elements `tet10` and `tet10-mixed`.")
    if mechanism.needs:
        return [*lines, f"Told apart by {', '.join(mechanism.needs)}."]
    return lines


def derivatives(mechanism: type[Mechanism]) -> list[str]:
    """How a state is differentiated by its parameters: by differences along the way, or not, where one switches."""
    lines = []
    parameters = mechanism.parameters().items()
    numbers = [f"`{key}`" for key, spec in parameters if spec.kind in NUMBERS and not spec.method]
    if numbers:
        lines.append(f"[Derivatives](../solvers.md#derivatives) by {', '.join(numbers)}.")
    for key, spec in mechanism.parameters().items():
        if spec.choices:
            lines.append(f"`{key}` is one of {', '.join(spec.choices)}: a secant, not a derivative.")
    if mechanism.switches:
        lines.append("It is there or not: a secant, not a derivative.")
    return lines


def _parameters(mechanism: type[Mechanism]) -> list[str]:
    lines = []
    for name, spec in mechanism.parameters().items():
        unit = "`units`" if spec.kind == "position" else spec.unit
        parts = [f"- `{name}`{f' [{unit}]' if unit else ''}: {mechanism.described(name)}"]
        if spec.expectation is not None:
            parts.append(f"Expected: {spec.expectation}.")
        if spec.typical:
            parts.append(f"Typical: {spec.typical}.")
        if spec.source:
            parts.append(f"Source: {spec.source}.")
        lines.append(" ".join(parts))
    return lines


def _picture(mechanism: type[Mechanism], effect: Effect) -> list[str]:
    state = f"{effect.steps} ms after the load came, from rest" if effect.steps else "in equilibrium"
    return [
        "```sh",
        f"warpbrain run {effect.command} --with {mechanism.example}",
        "```",
        "",
        f"![{mechanism.kind}: what it does to the phantom](../figures/mechanism-{mechanism.kind}.png)",
        "",
        f"Cut at y = {1000.0 * PLACE:.0f} mm. Right: what is added {state} ({MAGNIFIED:g} times), at most "
        f"{effect.largest:.2f} mm.",
    ]


# the page of what they mean together, and the table of all pairs -------------------------------------------------

_PAIRS_HEAD = """# Mechanisms together

Several mechanisms act together as one energy ([potential.py](../../warpbrain/physics/potential.py)), tabulated here by
`python docs/make_mechanisms.py`. `tests/physics/test_composition.py` checks every pair, and all at once, against that
energy in NumPy: forces and tangents in the second of two time steps, to 1e-9.
"""

_PAIRS_TABLE = """## All pairs

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
    lines = [_PAIRS_HEAD, f"```{{docstring}} {potential.__name__}", "```", "", "| place | mechanisms |", "|---|---|"]
    for place, meaning in potential.PLACES.items():
        there = [f"[{kind}]({kind}.md)" for kind, m in mechanisms().items() if m.enters.place == place]
        if there:
            lines.append(f"| {meaning} | {', '.join(there)} |")
    return "\n".join([*lines, "", _PAIRS_TABLE])


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
