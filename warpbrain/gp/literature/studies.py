"""Reads files of studies: the one that ships, and one that a user adds. Both have the same format.

The studies of the paper's Table 1 ship in `studies.toml` beside this file, in two variants:

- ``"as_published"``: what the paper trained on, all 73, slips included;
- ``"corrected"``: the slips mended, each with its reason in the file, and the one study that is invented left out.

    units = "Pa"                      # of all moduli in the file; or "kPa"

    [[study]]
    name = "Mine 2024"
    group = "hyperelastic/brain"      # method/anatomy, one of `GROUPS`
    mu = 900.0

is a whole file: the form is then linear for elastography and linear studies, else neo-Hookean, and the stretch the
range on which the paper samples the group. `form` and `convention` say otherwise (see `forms`), `stretch = [low, high]`
too; `compression` and `tension` are tables of parameters of a study that fitted the sides apart; `number`, `source`,
`checked` and `note` are for the reader. `corrected` is a table of what the variant "corrected" changes, with a
`reason`: parameters by themselves are changed one by one, after a new `form` or `convention` they replace all;
`out = true` leaves the study out.
"""

import math
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Literal

import numpy as np

from warpbrain.errors import InputError
from warpbrain.gp.literature.forms import FORMS, Convention, Parameter, Parameters
from warpbrain.gp.literature.study import GROUPS, STRETCHES, Study
from warpbrain.keys import finite, short
from warpbrain.problems import Problems, Unreadable, nearest
from warpbrain.recordings.text import read_text

Variant = Literal["as_published", "corrected"]
VARIANTS: tuple[Variant, ...] = ("as_published", "corrected")

#: Moduli may be given in these [Pa].
UNITS = {"Pa": 1.0, "kPa": 1e3}
#: Shear moduli [Pa] outside which a unit must be wrong; published ones of brain, tumour and ventricle are 5 to 35 000.
MODULI = (1.0, 1e7)
#: Keys of a study that are no parameters of its form.
_TEXTS = ("name", "group", "form", "convention", "source", "checked", "note")
_SIDES = ("compression", "tension")
_KEYS = (*_TEXTS, *_SIDES, "number", "stretch", "corrected")
#: Points at which the energy of a study is looked at.
_LOOKS = 201


def read_studies(variant: Variant = "corrected", add: Path | str | None = None) -> tuple[Study, ...]:
    """The studies that ship, in the order of the paper's Table 1, and after them those of a file of the user's.

    Parameters
    ----------
    variant : {"corrected", "as_published"}
    add : path, optional
        A TOML file with tables ``[[study]]``, as this module says. None may be there twice or have a name that ships.

    Raises
    ------
    InputError
        With everything that is wrong with the file, a line each.

    Examples
    --------
    >>> len(read_studies("as_published")), len(read_studies("corrected"))
    (73, 72)
    """
    if variant not in VARIANTS:
        raise InputError(
            f"variant = {variant!r}: found no such variant of the literature ({nearest(variant, VARIANTS)})"
        )
    shipped = _shipped(variant)
    return shipped if add is None else shipped + _read(Path(add), variant, _shipped("as_published"))


@cache
def _shipped(variant: Variant) -> tuple[Study, ...]:
    with as_file(files("warpbrain.gp.literature") / "studies.toml") as path:
        return _read(path, variant)


def _read(path: Path, variant: Variant, shipped: Iterable[Study] = ()) -> tuple[Study, ...]:
    """Studies of a file, none of which may have the name of another one or of one that ships."""
    problems = Problems()
    tables, unit = _read_tables(path, problems)
    owners = {study.name: "a study that ships" for study in shipped}
    studies = []
    for index, table in enumerate(tables, 1):
        entry = _Entry(path, index, table, unit, problems)
        if isinstance(name := table.get("name"), str):
            if name in owners:
                fault = f"found '{name}', which is the name of {owners[name]} already"
                entry.problem("name", fault, "give it another name")
            owners.setdefault(name, entry.where)
        if variant == "corrected":
            entry.correct()
        if not entry.out and (study := entry.study()) is not None:
            studies.append(study)
    if problems:
        raise InputError("\n".join(map(str, problems.found)))
    return tuple(studies)


def _read_tables(path: Path, problems: Problems) -> tuple[list[dict[str, Any]], float]:
    """Tables `[[study]]` of a file as they are, and the unit of its moduli [Pa]; no tables where there are problems."""
    try:
        content = tomllib.loads(read_text(path, problems))
    except Unreadable:
        return [], 1.0
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, thousands of brackets
        problems.add(path, "", f"found text that is not valid TOML: {error}", "is the file cut off?")
        return [], 1.0
    for key in content:
        if key not in ("study", "units"):
            problems.add(path, key, "unknown key", nearest(key, ("study", "units")))
    units = content.get("units", "Pa")
    if not isinstance(units, str) or units not in UNITS:
        problems.add(path, "units", f"found {short(units)}, expected one of {', '.join(UNITS)}")
        units = "Pa"
    entries = content.get("study")
    if isinstance(entries, dict):
        problems.add(path, "study", "found one table, expected a list of them", "write [[study]] with two brackets")
    elif not isinstance(entries, list) or not entries or not all(isinstance(entry, dict) for entry in entries):
        fault = "found none" if entries is None else f"found {short(entries)}"
        problems.add(path, "study", f"{fault}, expected at least one table [[study]]")
    else:
        return entries, UNITS[units]
    return [], 1.0


class _Entry:
    """One `[[study]]` of a file, the `index`th from 1: its values in a variant, with every fault noted as a problem."""

    def __init__(self, path: Path, index: int, values: dict[str, Any], unit: float, problems: Problems) -> None:
        self.path, self.unit, self.problems = path, unit, problems
        self.values = dict(values)
        name = values.get("name")
        self.where = f"study {index} '{name}'" if isinstance(name, str) else f"study {index}"
        self.reason: str | None = None
        self.out = False

    def problem(self, key: str, message: str, cure: str = "") -> None:
        self.problems.add(self.path, f"[{self.where}] {key}".rstrip(), message, cure)

    def correct(self) -> None:
        """Change the values as `corrected` says."""
        change = self.values.pop("corrected", None)
        if change is None:
            return
        if not isinstance(change, dict):
            self.problem("corrected", f"found {short(change)}, expected a table")
            return
        change = dict(change)
        reason, out = change.pop("reason", None), change.pop("out", False)
        if not isinstance(reason, str) or not reason.strip():
            self.problem("corrected", f"found reason {short(reason)}, expected text", "say why it differs")
            return
        if not isinstance(out, bool) or (out and change) or not (out or change):
            self.problem("corrected", "expected either out = true or keys that change")
            return
        new = {key for key in change if key not in _TEXTS and key not in ("number", "stretch")}
        if new and ("form" in change or "convention" in change):
            self.values = {key: value for key, value in self.values.items() if key in _KEYS and key not in _SIDES}
        self.values |= change
        self.reason, self.out = reason, out

    def study(self) -> Study | None:
        """The study; None if there was a problem."""
        before = len(self.problems.found)
        texts = {key: self._text(key) for key in _TEXTS}
        for key in ("name", "group"):
            if key not in self.values:
                self.problem(key, "missing", "every study has a name and a group")
        group = texts["group"]
        if group and group not in GROUPS:
            self.problem("group", f"found '{group}', expected method/anatomy", nearest(group, GROUPS))
            group = ""
        usual = "neo-hookean" if group.startswith("hyperelastic/") else "linear"
        form = texts["form"] or (usual if group else "")
        if form and form not in FORMS:
            self.problem("form", f"found '{form}', which is no known form", nearest(form, FORMS))
            form = ""
        number = self.values.get("number")
        if number is not None and (isinstance(number, bool) or not isinstance(number, int) or number < 0):
            self.problem("number", f"found {short(number)}, expected a whole number of at least 0")
        stretch = self._stretch(group)
        if not form:
            return None  # what its keys should be is not known
        sides = self._sides(form, texts["convention"])
        if len(self.problems.found) > before or stretch is None or sides is None:
            return None
        texts |= {"form": form, "convention": sides[0]}
        study = Study(
            compression=sides[1], tension=sides[2], stretch=stretch, reason=self.reason, number=number, **texts
        )
        self._examine(study)
        return study if len(self.problems.found) == before else None

    def _text(self, key: str) -> str:
        value = self.values.get(key, "")
        if isinstance(value, str) and (value.strip() or key not in self.values):
            return value
        self.problem(key, f"found {short(value)}, expected text")
        return ""

    def _stretch(self, group: str) -> tuple[float, float] | None:
        if "stretch" not in self.values:
            return STRETCHES.get(group)
        value = self.values["stretch"]
        if isinstance(value, list) and len(value) == 2 and all(map(finite, value)):
            low, high = map(float, value)
            if 0.0 < low < 1.0 < high:
                return low, high
        cure = "1 is rest: 0.9 is a tenth shorter" if isinstance(value, list) else ""
        self.problem("stretch", f"found {short(value)}, expected [low, high] with 0 < low < 1 < high", cure)
        return None

    def _sides(self, form: str, named: str) -> tuple[str, Parameters, Parameters] | None:
        """Convention and parameters in compression and in tension."""
        common = {key: value for key, value in self.values.items() if key not in _KEYS}
        tables = {side: self.values[side] for side in _SIDES if side in self.values}
        for side, table in tables.items():
            if not isinstance(table, dict):
                self.problem(side, f"found {short(table)}, expected a table of the parameters on that side")
                return None
        keys = list(dict.fromkeys([*common, *(key for table in tables.values() for key in table)]))
        known = FORMS[form].conventions
        if named and named not in known:
            self.problem("convention", f"found '{named}', not one of form '{form}'", nearest(named, known))
            return None
        convention = named or FORMS[form].convention_of(keys)
        if not tables:
            both = self._parameters(form, known[convention], "", common)
            return None if both is None else (convention, both, both)
        if len(tables) == 1:
            [there] = tables
            missing = _SIDES[1 - _SIDES.index(there)]
            self.problem(missing, f"missing, found {there} only", "give both sides, or one set of parameters for both")
            return None
        if common:
            names = ", ".join(common)
            self.problem(names, "found beside compression and tension", "parameters of a side stand in its table")
            return None
        sides = [self._parameters(form, known[convention], f"{side}.", tables[side]) for side in _SIDES]
        return None if sides[0] is None or sides[1] is None else (convention, sides[0], sides[1])

    def _parameters(self, form: str, convention: Convention, side: str, given: dict[str, Any]) -> Parameters | None:
        keys, before = convention.keys, len(self.problems.found)
        for name, value in given.items():
            if name not in keys:
                self.problem(side + name, f"unknown key with form '{form}'", self._meant(form, name, keys, side))
            elif wrong := _fault(keys[name], value):
                self.problem(side + name, wrong)
        for name, key in keys.items():
            if name not in given:
                unit = f" [{key.unit}]" if key.unit else ""
                self.problem(side + name, "missing", f"form '{form}' takes {', '.join(keys)}; {name} is a number{unit}")
        if len(self.problems.found) > before:
            return None
        numbers: dict[str, float | tuple[float, ...]] = {}
        for name, key in keys.items():
            scale = self.unit if key.unit else 1.0
            value = given[name] if isinstance(given[name], list) else [given[name]]
            scaled = tuple(scale * float(item) for item in value)
            numbers[name] = scaled if key.several else scaled[0]
        lengths = {name: len(value) for name, value in numbers.items() if isinstance(value, tuple)}
        if len(set(lengths.values())) > 1:
            counts = " and ".join(f"{length} of {name}" for name, length in lengths.items())
            self.problem(side + ", ".join(lengths), f"found {counts}, expected as many", "one of each for every term")
            return None
        return convention.convert(**numbers)

    @staticmethod
    def _meant(form: str, name: str, keys: Mapping[str, Parameter], side: str) -> str:
        """What an unknown key may be: one that is spelt like it, or one of other forms."""
        owners = [
            other for other, known in FORMS.items() if any(name in way.keys for way in known.conventions.values())
        ]
        near = nearest(name, [*keys, *(() if side else _KEYS)])
        if near.startswith("did"):
            return near
        takes = f"form '{form}' takes {', '.join(keys)}"
        return f"{takes}; {name} is of {', '.join(owners)}" if owners else takes

    def _examine(self, study: Study) -> None:
        """Note an energy that cannot be one, and a modulus in another unit."""
        stretches = study.grid(_LOOKS)
        stretches = stretches[np.abs(stretches - 1.0) > 1e-9]
        with np.errstate(all="ignore"):
            energies = study.energy(stretches)
        if not np.isfinite(energies).all():
            at = stretches[~np.isfinite(energies)]
            worst = at[np.argmin(np.abs(at - 1.0))]
            cure = "its range ends before that: give a narrower stretch"
            self.problem("", f"the energy is not finite at the stretch {worst:.3g}", cure)
            return
        if not (energies > 0.0).all():
            worst = int(np.argmin(energies))
            fault = f"the energy is {energies[worst]:.3g} Pa at the stretch {stretches[worst]:.3g}, expected above 0"
            self.problem("", f"{fault} everywhere but at 1", "is a sign, or the convention, another one?")
            return
        for modulus in set(study.shear_moduli):
            if not MODULI[0] <= modulus <= MODULI[1]:
                fault = f"the shear modulus at rest is {modulus:.3g} Pa, expected {MODULI[0]:g} to {MODULI[1]:g} Pa"
                cure = 'write units = "kPa" at the top of the file if that is meant' if modulus < MODULI[0] else ""
                self.problem("", fault, cure)


def _fault(key: Parameter, value: Any) -> str:
    """What is wrong with a parameter, in words; empty if nothing is."""
    unit = f" [{key.unit}]" if key.unit else ""
    items = value if key.several and isinstance(value, list) else [value]
    if not items or not all(finite(item) for item in items):
        expected = "a finite number or a list of them" if key.several else "a finite number"
        return f"found {short(value)}, expected {expected}{unit}"
    for item in items:
        if not key.zero and item == 0:
            return f"found {short(value)}, expected no 0"
        if not key.above < item < key.below:
            if math.isinf(key.below):
                return f"found {item:g}, expected a number above {key.above:g}{unit}"
            return f"found {item:g}, expected a number in the open interval ({key.above:g}, {key.below:g}){unit}"
    return ""
