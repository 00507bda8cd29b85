"""One try: a file of a case folder is damaged, the folder is read, and what came of it is judged."""

from __future__ import annotations

import contextlib
import io
import shutil
import tempfile
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from damage.folders_to_damage import MESHES
from damage.kinds import KINDS
from warpbrain.cases.reading import read_case
from warpbrain.errors import InputError


@dataclass(frozen=True)
class Outcome:
    """What came of a try.

    Attributes
    ----------
    seed : int
        Of the try: `one_try` with it does the same again.
    file, damage : str
    seconds : float
    refused : str
        The message of the error; empty if the case was read.
    defect : str
        What must not be: another exception with its traceback, a message that is not one line or names no file,
        something printed; empty if nothing was wrong.
    """

    seed: int
    file: str
    damage: str
    seconds: float
    refused: str = ""
    defect: str = ""


def one_try(whole: Path, seed: int) -> Outcome:
    """Damage a file of a copy of a folder, sometimes two, and read it."""
    rng = np.random.default_rng(seed)
    names = sorted(path.relative_to(whole).as_posix() for path in whole.rglob("*") if path.is_file())
    name = names[rng.integers(len(names))]
    damage = KINDS[rng.integers(len(KINDS))]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "case"
        shutil.copytree(whole, folder)
        if name in MESHES:
            text = (folder / "case.toml").read_text()
            (folder / "case.toml").write_text(text.replace('"mesh.vtu"', f'"{name}"'))
        content = damage((folder / name).read_bytes(), rng)
        if rng.random() < 0.1:
            content = KINDS[rng.integers(len(KINDS))](content, rng)
        (folder / name).write_bytes(content)
        return judged(folder, seed, name, damage.__name__)


def judged(folder: Path, seed: int = 0, name: str = "", damage: str = "") -> Outcome:
    """Read a folder; see `Outcome`."""
    printed = io.StringIO()
    began = time.perf_counter()
    refused = defect = ""
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            read_case(folder)
    except InputError as error:
        refused = str(error)
        if "\n" in refused or str(folder) not in refused or len(refused) > 1500:
            defect = f"message: {refused!r}"
    except BaseException:
        defect = traceback.format_exc()
    if printed.getvalue() and not defect:
        defect = f"printed: {printed.getvalue()[:500]!r}"
    return Outcome(seed, name, damage, time.perf_counter() - began, refused, defect)
