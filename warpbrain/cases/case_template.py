"""The text of a new `case.toml`, made from `new_case.txt`: what is needed to run, and what its user may want to add."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files

from jinja2 import Environment

#: Shear modulus [Pa] of tissues that are not named, between those of grey and white matter.
OTHER_MU = 1200.0
#: Of brain [kg/m3]: ICRU Report 44 (1989), Tissue substitutes in radiation dosimetry and measurement. The
#: paper's 1211.5 kg/m3, which the shipped cases have, are of its own table.
DENSITY = 1040.0
#: Shear moduli [Pa] of the shipped cases, the paper's reference for its multi-tissue phantom.
MU = {"grey matter": 1370.0, "white matter": 1000.0}


def case_text(name: str, source: str, tissues: Mapping[int, str], cavities: bool, resected: bool = False) -> str:
    """Text of a `case.toml` that can be run as it is, of a mesh that was made from the file `source`: names of its
    tissues by number, whether it has the node set `ventricle`, and the element set `resection`, which is then taken
    out."""
    environment = Environment(trim_blocks=True, keep_trailing_newline=True)
    environment.filters["quoted"] = quoted
    template = environment.from_string((files("warpbrain.cases") / "new_case.txt").read_text(encoding="utf-8"))
    return template.render(
        name=name, source=source, tissues=tissues, cavities=cavities, resected=resected, moduli=MU, other=OTHER_MU,
        density=DENSITY,
    )  # fmt: skip


def quoted(text: str) -> str:
    """A string as TOML writes it: as JSON does, but for one control character that JSON leaves alone."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
