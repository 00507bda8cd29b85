"""The mechanisms that a case assumes to act."""

from __future__ import annotations

import numpy as np

from warpbrain.cases.case import Mechanism
from warpbrain.cases.format.table import Reading
from warpbrain.cases.format.tables import MECHANISM
from warpbrain.cases.parts.context import Context
from warpbrain.errors import InputError
from warpbrain.physics.gravity import Gravity
from warpbrain.physics.resection import Resection

#: `csf_level` is in mm whatever the case's units, as its page says.
_METRES_OF_LEVEL = 1e-3


def read_mechanisms(context: Context, axis: tuple[float, float, float] | None, density: float) -> tuple[Mechanism, ...]:
    """Mechanisms in the order of the file, as far as they are right; `axis` is where 'down' is."""
    found: list[Mechanism] = []
    kinds: set[str] = set()
    for table in context.lists(MECHANISM):
        if table.variant is None:
            continue
        if table.variant in kinds:
            table.problem("kind", f"a second '{table.variant}': it would act twice")
        kinds.add(table.variant)
        term = _gravity(context, table, axis, density) if table.variant == "gravity" else _resection(context, table)
        if term is not None:
            found.append(term)
    return tuple(found)


def _gravity(
    context: Context, table: Reading, axis: tuple[float, float, float] | None, density: float
) -> Gravity | None:
    if axis is None:
        if "gravity_axis" not in context.tables.get("case", {}):
            context.problems.add(
                context.file,
                "[case] gravity_axis",
                "missing, but [[mechanism]] gravity needs to know where 'down' is",
                "gravity_axis = [0, -1, 0] for a patient who lies on the back, in RAS",
            )
        return None
    if context.mesh is None or not table.has("csf_level"):
        return None
    # counted from the whole anatomy: a resection must not move the datum
    lowest = float((-context.mesh.points @ (np.array(axis) / np.linalg.norm(axis))).min())
    level = _METRES_OF_LEVEL * float(table.get("csf_level"))
    return Gravity(direction=axis, density=density, csf_level=level, lowest=lowest)


def _resection(context: Context, table: Reading) -> Resection | None:
    resection = Resection(elements=table.get("elements", "resection"))
    if context.mesh is None:
        return None
    try:
        resection.remaining(context.mesh)
    except InputError as error:
        table.problem("elements", str(error))
        return None
    return resection
