"""Trained models: those that ship, those of a user, and the fitting of either kind with a record of how it went.

A model is a folder with `model.json`, which holds the parameters, the variant of the literature they are of and how
they were found, and with `studies.toml`, the studies that a user added, if any. Factors are computed when they are
first needed. Hierarchical models have `"format": 2`. The first format knew no mean asymmetry, and its effects mean
other things than those of today: such a model is fitted again to its own studies when it is read, which takes seconds.
"""

import json
import time
import warnings
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Literal

import numpy as np

from warpbrain.atomic import write_text
from warpbrain.errors import InputError
from warpbrain.gp.coregionalised import JITTER, TASKS, Coregionalised, Parameters, train, training_points
from warpbrain.gp.hierarchy import EFFECTS, Hierarchical, Hierarchy
from warpbrain.gp.literature.studies import VARIANTS, Variant, read_studies
from warpbrain.gp.literature.study import GROUPS
from warpbrain.gp.process import KERNELS, Process
from warpbrain.keys import finite

Kind = Literal["hierarchical", "coregionalised"]
#: Kinds of models, the default first.
KINDS: tuple[Kind, ...] = ("hierarchical", "coregionalised")

MODEL, STUDIES = "model.json", "studies.toml"
#: Of the file of a hierarchical model.
FORMAT = 2


@cache
def trained(kind: Kind = "hierarchical", variant: Variant = "corrected") -> Process:
    """A model that ships.

    Raises
    ------
    InputError
        If there is no such kind or variant.

    Examples
    --------
    >>> trained().groups[0]
    'MRE/grey matter'
    """
    for name, value, known in (("kind", kind, KINDS), ("variant", variant, VARIANTS)):
        if value not in known:
            raise InputError(f"{name} {value!r}: expected one of {', '.join(known)}")
    with as_file(files("warpbrain.gp") / "models" / f"{kind}-{variant}") as folder:
        return read_model(folder)


def find_model(name: str | Path, variant: Variant = "corrected") -> Process:
    """A model that ships, by its kind, or one of a user's, by its folder."""
    if name in KINDS:
        return trained(name, variant)
    if not Path(name).exists():
        raise InputError(
            f"{name}: no such generative model: expected {', '.join(KINDS)} or a folder of warpbrain gp fit"
        )
    model: Any = read_model(Path(name))
    return replace(model, folder=Path(name))


def read_model(folder: Path) -> Process:
    """A model that was written by `write_model`; `InputError` with file and key if something is not as it should be."""
    path = folder / MODEL
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, thousands of brackets
        raise InputError(f"{path}: not JSON ({error})") from None
    if not isinstance(table, dict):
        raise InputError(f"{path}: found {type(table).__name__}, expected a table")
    kind = _choice(path, table, "kind", KINDS)
    variant: Variant = _choice(path, table, "variant", VARIANTS)
    kernel = _choice(path, table, "kernel", tuple(KERNELS))
    added = folder / STUDIES
    studies = read_studies(variant, added if added.exists() else None)
    numbers = table.get("parameters")
    if not isinstance(numbers, dict):
        raise InputError(f"{path}: parameters: expected a table")
    if kind == "hierarchical":
        if _choice(path, table | {"format": table.get("format", 1)}, "format", (1, FORMAT)) == 1:
            warnings.warn(f"{path}: of an older format, without a mean asymmetry: fitted again", stacklevel=2)
            return Hierarchical.fitted(studies, variant, kernel)[0]
        sample = table.get("sample")
        if not isinstance(sample, list) or not all(isinstance(drawn, dict) for drawn in sample):
            raise InputError(f"{path}: sample: expected tables of parameters")
        best, *others = (
            Hierarchy(
                {name: _positive(path, each, name) for name in EFFECTS}, _positive(path, each, "length scale"), kernel
            )
            for each in (numbers, *sample)
        )
        return Hierarchical(studies, best, variant, tuple(others))
    length_scale = _positive(path, numbers, "length scale")
    arrays = {name: _numbers(path, numbers, name) for name in ("w", "kappa", "noise")}
    try:
        parameters = Parameters(length_scale, **arrays)
    except InputError as error:
        raise InputError(f"{path}: parameters: {error}") from None
    return Coregionalised(studies, parameters, variant, kernel, _positive(path, numbers, "jitter"))


def fit_model(
    kind: Kind = "hierarchical",
    variant: Variant = "corrected",
    add: Path | None = None,
    *,
    climbs: int = 1,
    progress: Callable[[float, str], None] = lambda part, text: None,
) -> tuple[Process, dict[str, Any]]:
    """Fit a model to the literature and to the studies of a user's file (`warpbrain.gp.literature.studies`).

    For `climbs` and `progress` see `warpbrain.gp.coregionalised.train`. Returns the model and, for `write_model` and
    for the reader, a record: objective, convergence, restarts, conditioning and seconds. `InputError` if the file of
    studies is wrong; `SolveError` if no covariance can be factored.
    """
    began = time.perf_counter()
    studies = read_studies(variant, add)
    options = (f" --climbs {climbs}" if climbs > 1 else "") + (" --add studies.toml" if add else "")
    command = f"warpbrain gp fit --gp {kind} --variant {variant}{options}"
    record: dict[str, Any] = {"command": command, "studies": len(studies)}
    model: Process
    if kind == "hierarchical":
        progress(0.0, "climbing")
        model, fitted = Hierarchical.fitted(studies, variant)
        record |= asdict(fitted)
    else:
        data = training_points(studies)
        training = train(data, climbs=climbs, progress=progress)
        model = Coregionalised(studies, training.best.parameters, variant)
        record |= {
            "points": int(data.count.sum()),
            "means of replicates": data.size,
            "jitter": JITTER,
            "negative log likelihood": training.best.value,
            "climbs": [climb.described() for climb in training.climbs],
            "starts": [
                {"apart": None if start.apart is None else GROUPS[start.apart], "every": training.step}
                | start.climb.described()
                for start in training.starts
            ],
        }
    record["seconds"] = time.perf_counter() - began
    return model, record


def write_model(folder: Path, model: Process, record: dict[str, Any], added: Path | None = None) -> None:
    """Write a model with the record of its training, and the user's studies if any, to a folder that is there."""
    table: dict[str, Any] = {"kind": model.name, "variant": model.variant}
    if isinstance(model, Hierarchical):
        best, *sample = (
            {**each.spread, "length scale": each.length_scale} for each in (model.hierarchy, *model.sample)
        )
        table |= {"kernel": model.hierarchy.kernel, "parameters": best, "training": record}
        table |= {"format": FORMAT, "sample": sample}
    else:
        assert isinstance(model, Coregionalised)
        numbers = model.parameters
        parameters = {"length scale": numbers.length_scale, "jitter": model.jitter}
        parameters |= {name: getattr(numbers, name).tolist() for name in ("w", "kappa", "noise")}
        table |= {"kernel": model.kernel, "parameters": parameters, "training": record}
    # the studies first: a model without them would be another one
    if added is not None:
        write_text(folder / STUDIES, added.read_text(encoding="utf-8"))
    write_text(folder / MODEL, json.dumps(table, indent=2) + "\n")


def _choice(path: Path, table: dict[str, Any], key: str, known: tuple[Any, ...]) -> Any:
    if table.get(key) not in known:
        raise InputError(f"{path}: {key} = {table.get(key)!r}: expected one of {', '.join(map(str, known))}")
    return table[key]


def _positive(path: Path, table: dict[str, Any], key: str) -> float:
    value = table.get(key)
    if value is None or not finite(value) or not value > 0.0:
        raise InputError(f"{path}: parameters: {key} = {value!r}: expected a positive number")
    return float(value)


def _numbers(path: Path, table: dict[str, Any], key: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    values = table.get(key)
    if not isinstance(values, list) or len(values) != TASKS or not all(map(finite, values)):
        raise InputError(f"{path}: parameters: {key}: expected {TASKS} finite numbers")
    return np.array(values, dtype=np.float64)
