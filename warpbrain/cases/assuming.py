"""Mechanisms that are said in one line, as on the command line: `gravity:level=60`."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from warpbrain.cases.case import Case
from warpbrain.cases.format.tables import MECHANISM
from warpbrain.cases.parts.named import Named
from warpbrain.errors import InputError, require_kind
from warpbrain.keys import Key
from warpbrain.physics.composition import require_composable, require_left
from warpbrain.physics.mechanism import NUMBERS, Facts, ParameterError, ParameterSpec, Removing
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.problems import Problems, nearest


def assume(case: Case, said: str) -> Case:
    """The same case with one more mechanism; one that a case can have only once takes the place of the case's own,
    which is said in its remarks.

    Parameters
    ----------
    case : Case
    said : str
        ``kind`` or ``kind:key=value,key=value``: values as in `case.toml`, in the case's units and axes; several
        numbers of one key are joined by ``/``. The last word of a key will do where no other key ends with it. Files
        are named from the working directory.

    Raises
    ------
    InputError
        If there is no such mechanism or key, a value is not one, something needed is missing, or the mechanism has no
        meaning together with one that the case has.

    Examples
    --------
    >>> from warpbrain.cases.shipped import find_case
    >>> assume(find_case("0529"), "traction:centre=0/0/80,value=0/0/-500").mechanisms[-1].kind
    'traction'
    """
    require_kind(case, Case, "case", "a Case, as warpbrain.find_case gives")
    require_kind(said, str, "said", 'a text such as "gravity:csf_level=60"')
    try:
        return _with(case, said)
    except ParameterError as error:
        raise InputError(f"{said}: {error.key}: {error}") from None
    except InputError as error:
        raise InputError(f"{said}: {error}") from None


def _with(case: Case, said: str) -> Case:
    kind, _, rest = said.partition(":")
    known = mechanisms()
    if kind not in known:
        raise InputError(f"no mechanism '{kind}': {nearest(kind, known)}")
    mechanism, specs, keys = known[kind], known[kind].parameters(), MECHANISM.keys_of(kind)
    values: dict[str, Any] = {}
    named = Named(case.mesh, case.tissues, case.frame, Problems())
    for part in rest.split(",") if rest else []:
        word, equals, text = part.partition("=")
        matching = [key for key in specs if key == word] or [key for key in specs if key.endswith(f"_{word}")]
        if len(matching) != 1:
            raise InputError(f"no key '{word}' of {kind}: expected one of {', '.join(specs)}")
        key = matching[0]
        if not equals or key in values:
            raise InputError(f"{part}: expected KEY=VALUE, each key once")
        value = keys[key].in_si(_value(specs[key], keys[key], text), case.frame)
        values[key] = named.look_up(specs[key].kind, value, partial(Path, value)) if isinstance(value, str) else value
        if named.problems:
            raise InputError(f"{key}: {named.problems.found[0]}")
    missing = [key for key in mechanism.required() if key not in values]
    if missing:
        spec = specs[missing[0]]
        raise InputError(f"{missing[0]} is missing{f' [{spec.unit}]' if spec.unit else ''}: {spec.doc}")
    others = tuple(there for there in case.mechanisms if mechanism.several or there.kind != kind)
    removing = tuple(there for there in others if isinstance(there, Removing))
    facts = Facts(named.mesh, case.gravity_axis, case.density, removing)
    acting = (*others, mechanism.of_case(values, facts))
    require_composable(acting, require_left(acting, named.mesh))
    replaced = () if len(others) == len(case.mechanisms) else (f"in place of its {kind}: {said}",)
    return replace(case, mesh=named.mesh, mechanisms=acting, remarks=(*case.remarks, *replaced))


def _value(spec: ParameterSpec, key: Key, text: str) -> Any:
    if spec.kind not in NUMBERS:
        if fault := key.fault(text):
            raise InputError(f"{key.name}: {fault}")
        return text
    try:
        numbers = [float(part) for part in text.split("/")]
    except ValueError:
        numbers = []
    count = {"number": 1, "position": 3, "vector": 3}.get(spec.kind)
    if not numbers or (count is not None and len(numbers) != count):
        expected = {1: "a number", 3: "three numbers joined by /"}.get(count or 0, "numbers joined by /")
        raise InputError(f"{key.name}: found '{text}', expected {expected}{f' [{spec.unit}]' if spec.unit else ''}")
    for number in numbers:
        if fault := replace(key, kind="number").fault(number):
            raise InputError(f"{key.name}: {fault}")
    return numbers[0] if count == 1 else numbers
