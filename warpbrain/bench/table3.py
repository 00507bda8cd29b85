"""The paper's Table 3: elapsed times of the deformation of its synthetic phantom, and which of our cases stands beside.

Supplement of "A Generative Model of Hyperelastic Strain Energy Density Functions for Multiple Tissue Brain
Deformation", Table 3: mean (sd) in ms, Intel Core i7 at 2.8 GHz with an NVIDIA GeForce GTX 1060. The paper does not
publish the sizes of these meshes; ours are at least as large as the median clinical mesh of its Table 5.
"""

from __future__ import annotations

from dataclasses import dataclass

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


def _row(name: str, case: str, tissue: str, preprocessing: float, *times: tuple[float, float]) -> Row:
    return Row(name, case, tissue, preprocessing, dict(zip((*PHASES, MAIN_LOOP), times, strict=True)))


TABLE3 = {
    row.name: row
    for row in (
        _row(
            "st/coarse", "phantom", "single", 569,
            (27.44, 3.9), (18.32, 2.0), (63.36, 4.9), (4.95, 5.4), (118.78, 10.2),
        ),
        _row(
            "st/fine", "phantom-fine", "single", 1026,
            (36.4, 3.6), (28.31, 2.5), (90.4, 5.3), (4.16, 1.2), (164.2, 8.9),
        ),
        _row(
            "mt/coarse", "phantom", "multi", 2577,
            (70.93, 5.2), (55.43, 3.6), (174.03, 6.1), (5.91, 7.6), (310.9, 11.8),
        ),
        _row(
            "mt/fine", "phantom-fine", "multi", 9953,
            (126.99, 14.9), (136.8, 5.6), (437.54, 9.5), (5.27, 1.4), (710.87, 17.0),
        ),
    )
}  # fmt: skip
