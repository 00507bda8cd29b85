"""The mechanisms that a case assumes to act: whatever the registry has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from warpbrain.cases.format.table import Reading
from warpbrain.cases.format.tables import MECHANISM
from warpbrain.cases.parts.context import Context
from warpbrain.cases.parts.named import Named
from warpbrain.cases.parts.ramps import read_ramp
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.physics.load import Load, take_turns
from warpbrain.physics.mechanism import Facts, Mechanism, ParameterError, Removing, Says
from warpbrain.physics.mechanisms import mechanisms

#: What to do where something of the case itself is missing.
_CURES = {"gravity_axis": "gravity_axis = [0, -1, 0] for a patient who lies on the back, in RAS"}


def read_mechanisms(
    context: Context, named: Named | None, axis: tuple[float, float, float] | None, density: float
) -> tuple[Mechanism, ...]:
    """Mechanisms in the order of the file, as far as they are right.

    Parameters
    ----------
    context : Context
    named : Named or None
        The mesh and what can be named; gains what the mechanisms name. None if there is no mesh.
    axis : (float, float, float) or None
        Where 'down' is.
    density : float
        [kg/m3]
    """
    found: dict[int, Mechanism] = {}
    kinds: set[str] = set()
    # all others act on what is left by those that remove elements
    tables = [(place, t.variant, t) for place, t in enumerate(context.lists(MECHANISM)) if t.variant is not None]
    for place, kind, table in sorted(tables, key=lambda entry: not issubclass(mechanisms()[entry[1]], Removing)):
        mechanism = mechanisms()[kind]
        if kind in kinds and not mechanism.several and not issubclass(mechanism, Load):
            table.problem("kind", f"a second '{kind}': it would act twice")
        kinds.add(kind)
        ramp = read_ramp(table)
        if named is None or ramp is None or not all(table.has(name) for name in mechanism.required()):
            continue
        values = {
            name: _value(context, table, named, name, says)
            for name, says in mechanism.parameters().items()
            if table.has(name)
        }
        wrong = [name for name in mechanism.parameters() if table.named(name) and not table.has(name)]
        if wrong or any(value is None for value in values.values()):
            continue
        try:
            facts = Facts(named.mesh, axis, density, tuple(m for m in found.values() if isinstance(m, Removing)))
            found[place] = mechanism.of_case(values | {"ramp": ramp}, facts)
        except ParameterError as error:
            _note(context, table, error)
        except InputError as error:
            table.problem("kind", str(error))
    _require_turns(tables, found)
    return tuple(found[place] for place in sorted(found))


def _require_turns(tables: Sequence[tuple[int, str, Reading]], found: Mapping[int, Mechanism]) -> None:
    """Note a problem where loads of a kind of which a case has one at a time act together."""
    for kind in dict.fromkeys(kind for _, kind, _ in tables):
        of_kind = [(place, table) for place, name, table in tables if name == kind]
        loads = [found[place] for place, _ in of_kind if place in found]
        if (
            len(loads) > 1
            and not mechanisms()[kind].several
            and issubclass(mechanisms()[kind], Load)
            and not take_turns(loads)
        ):
            cure = "give each a ramp, so that their factors add up to no more than 1 at any time"
            of_kind[-1][1].problem("kind", f"a second '{kind}': it would act twice", cure)


def _value(context: Context, table: Reading, named: Named, name: str, says: Says) -> Any:
    """A value as a mechanism takes it; None, and a problem noted, if a file that it names is wrong."""
    value = table.get(name)
    if isinstance(value, str):
        return named.look_up(says.kind, value, lambda: context.path(table, name))
    return in_si(says, value, context.frame)


def in_si(says: Says, value: Any, frame: Frame) -> Any:
    """A number or numbers of a file in SI units and RAS axes."""
    if says.kind == "position":
        return tuple(frame.lengths(value).tolist())
    if says.kind == "vector":
        return tuple((says.si * frame.directions(value)).tolist())
    if says.kind == "numbers":
        return tuple((says.si * np.asarray(value, dtype=float)).tolist())
    return says.si * float(value)


def in_file(says: Says, value: Any, frame: Frame) -> Any:
    """The same back: what a file says."""
    if says.kind == "position":
        return frame.file_lengths(value).tolist()
    if says.kind == "vector":
        return (frame.directions(value) / says.si).tolist()
    if says.kind == "numbers":
        return (np.asarray(value, dtype=float) / says.si).tolist()
    return value if isinstance(value, str) else value / says.si


def _note(context: Context, table: Reading, error: ParameterError) -> None:
    if error.key in _CURES:
        # of the case, not of this table; a wrong one is a problem already
        if error.key not in context.tables.get("case", {}):
            context.problems.add(context.file, f"[case] {error.key}", str(error), _CURES[error.key])
    else:
        table.problem(error.key, str(error))
