"""The cases that ship with the package, by name; a path to a case folder works wherever a name does."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from warpbrain.errors import InputError
from warpbrain.problems import nearest

if TYPE_CHECKING:
    from warpbrain.cases.case import Case

_DATA = Path(__file__).parent / "data"
CATALOGUE = _DATA / "catalogue.json"

#: Grey and white matter apart, or one tissue.
TISSUES = ("multi", "single")

#: Stand-ins for the paper's clinical cases.
STAND_INS = ("0529", "0614", "0660", "0685", "0535", "0555", "0603", "0684")
#: Measured landmarks of patients of the RESECT database, in the template brain: the phantom's mesh.
RESECT = tuple(f"resect-{number:02d}" for number in range(1, 16))
#: Recordings of a silicone beam: under its own weight, and with 52 g at its tip. It has one tissue.
BEAM = ("beam-gravity", "beam-52g")

#: Files of each shipped case by tissue mode, relative to the data folder.
SHIPPED = {
    **{name: {"multi": f"{name}/case.toml", "single": f"{name}/case-single.toml"} for name in (*STAND_INS, "phantom")},
    "phantom-fine": {"multi": "phantom/case-fine.toml", "single": "phantom/case-single-fine.toml"},
    "phantom-loaded": {"multi": "phantom/case-loaded.toml", "single": "phantom/case-single-loaded.toml"},
    **{name: {"multi": f"phantom/{name}.toml", "single": f"phantom/{name}-single.toml"} for name in RESECT},
    **{name: {"multi": f"beam/{name}.toml", "single": f"beam/{name}.toml"} for name in BEAM},
}


#: Other names of shipped cases: the paper calls its phantom synthetic.
ALIASES = {"synthetic": "phantom", "synthetic-fine": "phantom-fine"}


@dataclass(frozen=True)
class Entry:
    """What a shipped case is with one of its meshes."""

    name: str
    tissue: str  # ``"multi"`` or ``"single"``
    #: As `Case` has them.
    title: str
    origin: str
    #: Of the imaged anatomy, whole.
    nodes: int
    tetrahedra: int
    volume_cm3: float
    recordings: dict[str, int]  # how many rows, points or instants each has


def catalogue() -> list[Entry]:
    """Every shipped case, each once for every mesh, without reading these: its file is made where this package is."""
    return [Entry(**entry) for entry in json.loads(CATALOGUE.read_text(encoding="utf-8"))]


def files_of(name: str) -> list[Path]:
    """Every `case.toml` of a shipped case or of a folder: the one of many tissues, and that of one tissue if there.

    `InputError` if there is no such case and no such folder.
    """
    name = ALIASES.get(name, name)
    if name in SHIPPED:
        return [_DATA / file for file in dict.fromkeys(SHIPPED[name].values())]
    path = _existing(name)
    if not path.is_dir():
        return [path]
    return [path / "case.toml", *(file for file in [path / "case-single.toml"] if file.exists())]


def find_case(name: str, tissue: str = "multi") -> Case:
    """Read a shipped case, or the case in a folder.

    Parameters
    ----------
    name : str
        Name of a shipped case, or path of a case folder or of a `case.toml`.
    tissue : str
        ``"single"`` or ``"multi"``. A shipped case has a mesh of its own for each. Of a folder, ``"single"`` reads
        `case-single.toml`.

    Raises
    ------
    InputError
        If there is no such case, or it is wrong.
    """
    # names are asked for more often than cases, and a case needs Warp
    from warpbrain.cases.reading import read_case

    if tissue not in TISSUES:
        raise InputError(f"tissue {tissue!r}: expected 'multi' or 'single'")
    name = ALIASES.get(name, name)
    if name in SHIPPED:
        return read_case(_DATA / SHIPPED[name][tissue])
    path = _existing(name)
    if tissue == "single":
        if not path.is_dir():
            raise InputError(f"case '{name}': one tissue needs a case folder with a case-single.toml, this is a file")
        path = path / "case-single.toml"
    return read_case(path)


def as_case(case: Case | str | os.PathLike[str], tissue: str = "multi") -> Case:
    """A case that may be given itself, by name, or by its path.

    `InputError` if it is none of these, there is no such case, or it is wrong.
    """
    from warpbrain.cases.case import Case

    if isinstance(case, Case):
        return case
    if isinstance(case, str | os.PathLike):
        return find_case(os.fspath(case), tissue)
    raise InputError(
        f"case: expected a Case, the name of a shipped case or the path of a folder, found {type(case).__name__}: "
        "list(warpbrain.cases) has the names"
    )


def _existing(name: str) -> Path:
    # false, too, of a name that no file can have
    if not os.path.exists(name):
        hint = nearest(name, SHIPPED, f"there are: {', '.join(SHIPPED)}")
        raise InputError(f"case '{name}': no such case and no such folder ({hint})")
    return Path(name)
