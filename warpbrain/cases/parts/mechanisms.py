"""The mechanisms that a case assumes to act: whatever the registry has."""

from typing import Any

from warpbrain.cases.format.reading import Context, Reading
from warpbrain.cases.format.tables import MECHANISM
from warpbrain.cases.parts.named import Named
from warpbrain.errors import InputError
from warpbrain.physics.load import Load, take_turns
from warpbrain.physics.mechanism import Facts, Mechanism, ParameterError, Removing
from warpbrain.physics.mechanisms import mechanisms

#: What to do where something of the case itself is missing.
_CURES = {"gravity_axis": "gravity_axis = [0, -1, 0] for a patient who lies on the back, in RAS"}


def read_mechanisms(
    context: Context, named: Named | None, axis: tuple[float, float, float] | None, density: float
) -> tuple[Mechanism, ...]:
    """Mechanisms in the order of the file, as far as they are right.

    `named`: the mesh and what can be named; gains what the mechanisms name. None if there is no mesh.
    `axis`: where 'down' is.
    `density` [kg/m3].
    """
    acting: dict[int, Mechanism] = {}
    kinds: set[str] = set()
    # all others act on what is left by those that remove elements
    tables = [(place, t.variant, t) for place, t in enumerate(context.lists(MECHANISM)) if t.variant is not None]
    for place, kind, table in sorted(tables, key=lambda entry: not issubclass(mechanisms()[entry[1]], Removing)):
        mechanism = mechanisms()[kind]
        if kind in kinds and not mechanism.several and not issubclass(mechanism, Load):
            table.problem("kind", f"a second '{kind}': it would act twice")
        kinds.add(kind)
        ramp = table.ramp()
        if named is None or ramp is None or not all(table.has(name) for name in mechanism.required()):
            continue
        values = {name: _value(table, named, name) for name in mechanism.parameters() if table.has(name)}
        if any(map(table.wrong, mechanism.parameters())) or any(value is None for value in values.values()):
            continue
        try:
            facts = Facts(named.mesh, axis, density, tuple(m for m in acting.values() if isinstance(m, Removing)))
            acting[place] = mechanism.of_case(values | {"ramp": ramp}, facts)
        except ParameterError as error:
            if error.key not in _CURES:
                table.problem(error.key, str(error))
            elif error.key not in context.tables.get("case", {}):
                # of the case, not of this table; a wrong one is a problem already
                context.problem(f"[case] {error.key}", str(error), _CURES[error.key])
        except InputError as error:
            table.problem("kind", str(error))
    for kind in dict.fromkeys(kind for _, kind, _ in tables):
        of_kind = [(acting.get(place), table) for place, name, table in tables if name == kind]
        loads = [load for load, _ in of_kind if load is not None and isinstance(load, Load)]
        if not mechanisms()[kind].several and len(loads) > 1 and not take_turns(loads):
            cure = "give each a ramp, so that their factors add up to no more than 1 at any time"
            of_kind[-1][1].problem("kind", f"a second '{kind}': it would act twice", cure)
    return tuple(acting[place] for place in sorted(acting))


def _value(table: Reading, named: Named, name: str) -> Any:
    """A value as a mechanism takes it; None, and a problem noted, if a file that it names is wrong."""
    value = table.si(name)
    if not isinstance(value, str):
        return value
    kind = mechanisms()[str(table.variant)].parameters()[name].kind
    return named.look_up(kind, value, lambda: table.path(name))
