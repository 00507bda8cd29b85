"""The studies of the paper's Table 1 as they ship, in two variants, with those that a user adds.

- ``"as_published"``: what the paper trained on, all 73, slips included;
- ``"corrected"``: the slips mended, each with its reason in the file, and the one study that is invented left out.

The numbers are in `studies.toml` beside this file.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Literal

from warpbrain.errors import InputError
from warpbrain.gp.literature.reading import Entry, read_entries
from warpbrain.gp.literature.study import Study
from warpbrain.gp.literature.values import nearest
from warpbrain.problems import Problem, Problems

Variant = Literal["as_published", "corrected"]
VARIANTS: tuple[Variant, ...] = ("as_published", "corrected")


def read_studies(variant: Variant = "corrected", add: Path | str | None = None) -> tuple[Study, ...]:
    """The studies that ship, in the order of the paper's Table 1, and after them those of a file of the user's.

    Parameters
    ----------
    variant : {"corrected", "as_published"}
    add : path, optional
        A TOML file with tables ``[[study]]``; `warpbrain.gp.literature.reading` says what they hold.

    Raises
    ------
    InputError
        With everything that is wrong with the file, a line each.

    Examples
    --------
    >>> len(read_studies("as_published")), len(read_studies("corrected"))
    (73, 72)
    """
    _require_variant(variant)
    shipped = _shipped(variant)
    if add is None:
        return shipped
    problems = Problems()
    added = _read(Path(add), variant, problems)
    if problems:
        raise InputError("\n".join(map(str, problems.found)))
    return shipped + added


def check_studies(path: Path | str, variant: Variant = "corrected") -> tuple[Problem, ...]:
    """Everything that is wrong with a file of the user's; empty if it can be added."""
    _require_variant(variant)
    problems = Problems()
    _read(Path(path), variant, problems)
    return tuple(problems.found)


@cache
def _shipped(variant: Variant) -> tuple[Study, ...]:
    problems = Problems()
    with as_file(files("warpbrain.gp.literature") / "studies.toml") as path:
        studies = _studies(path, variant, problems, lambda entry, study: None)
    assert not problems, "\n".join(map(str, problems.found))
    return studies


def _read(path: Path, variant: Variant, problems: Problems) -> tuple[Study, ...]:
    """Studies of a user's file, none of which may be there twice or have a name that ships."""
    shipped = {study.name for study in _shipped("as_published")}
    seen: dict[str, str] = {}

    def check(entry: Entry, study: str) -> None:
        if study in seen or study in shipped:
            first = seen.get(study, "a study that ships")
            entry.problem("name", f"found '{study}', which is the name of {first} already", "give it another name")
        seen.setdefault(study, entry.where)

    return _studies(path, variant, problems, check)


def _studies(
    path: Path, variant: Variant, problems: Problems, check_name: Callable[[Entry, str], None]
) -> tuple[Study, ...]:
    tables, unit = read_entries(path, problems)
    studies = []
    for index, table in enumerate(tables, 1):
        entry = Entry(path, index, table, unit, problems)
        if isinstance(name := table.get("name"), str):
            check_name(entry, name)
        if variant == "corrected":
            entry.correct()
        if not entry.out and (study := entry.study()) is not None:
            studies.append(study)
    return tuple(studies)


def _require_variant(variant: str) -> None:
    if variant not in VARIANTS:
        raise InputError(
            f"variant = {variant!r}: found no such variant of the literature ({nearest(variant, VARIANTS)})"
        )
