"""The paper's Table 3: elapsed times of the deformation of its synthetic phantom, and which of our cases stands beside.

The numbers and where they are from are in `table3.toml`. The paper does not publish the sizes of these meshes; ours are
at least as large as the median clinical mesh of its Table 5.
"""

import tomllib
from dataclasses import dataclass
from importlib.resources import files

from warpbrain.simulation.dynamics import PHASES

#: The sum of the phases, the last column of the table.
MAIN_LOOP = "main loop"


@dataclass(frozen=True)
class Row:
    """A row of the table."""

    #: ``"st/coarse"`` and so on: single or multi tissue, and the mesh; and the shipped case that stands for it.
    name: str
    case: str
    tissue: str
    #: [ms], the second mean and sd by `PHASES` and `MAIN_LOOP`.
    preprocessing: float
    phases: dict[str, tuple[float, float]]


_TABLE = tomllib.loads((files("warpbrain.bench") / "table3.toml").read_text(encoding="utf-8"))
TABLE3 = {
    name: Row(name, **row | {"phases": dict(zip((*PHASES, MAIN_LOOP), map(tuple, row["phases"]), strict=True))})
    for name, row in _TABLE.items()
}
