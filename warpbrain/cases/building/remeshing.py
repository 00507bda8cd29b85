"""MMG: coarsen a fine, exactly cut mesh to the wanted number of nodes or tetrahedra."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.building.errors import BuildError
from warpbrain.cases.building.mmg import run_mmg

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# of the largest edge: the smallest edge, and how far surfaces may move from where they were cut
SMALLEST_EDGE = 0.3
SURFACE_TOLERANCE = 0.25
GRADATION = 2.2
TRIALS = 40


@dataclass(frozen=True)
class Cells:
    """A mesh in the making: points (n, 3) [mm], tetrahedra (m, 4), labels (m,)."""

    points: Floats
    tetrahedra: Integers
    labels: Integers


@dataclass(frozen=True)
class Size:
    """Wanted count of nodes or of tetrahedra, `at_least` to `at_most`."""

    of: str
    at_least: int
    at_most: int

    def count(self, cells: Cells) -> int:
        """What is counted, in a mesh."""
        return len(cells.points) if self.of == "nodes" else len(cells.tetrahedra)


def remesh(cells: Cells, edge: float) -> Cells | None:
    """One pass of MMG; None where MMG gives up, which it does for some sizes and not for their neighbours.

    Parameters
    ----------
    cells : Cells
        Interfaces between labels are kept, and moved by no more than the tolerance.
    edge : float
        Largest edge [mm].
    """
    # no ridge detection: a brain has no edges, and what looks like one is left over from the cutting
    options = {
        "hmax": edge,
        "hmin": SMALLEST_EDGE * edge,
        "hausd": SURFACE_TOLERANCE * edge,
        "hgrad": GRADATION,
        "angle": 0,
        "verbose": -1,
    }
    made = run_mmg(cells.points, cells.tetrahedra, cells.labels, options)
    return None if made is None else Cells(*made)


def fit_size(cells: Cells, size: Size, edge: float, good: Callable[[Cells], Cells | None]) -> Cells:
    """Find the edge length that gives the wanted count, and a mesh there that is good.

    Parameters
    ----------
    cells : Cells
        Fine mesh to start every trial from.
    size : Size
        What is wanted.
    edge : float
        First guess of the largest edge [mm].
    good : callable
        Finishes a mesh of the right size; None if it is not good enough.

    Returns
    -------
    Cells
        The first good mesh met; the search is deterministic.
    """
    goal = 0.5 * (size.at_least + size.at_most)
    seen: list[tuple[float, int]] = []
    for _ in range(TRIALS):
        made = remesh(cells, edge)
        if made is not None:
            count = size.count(made)
            seen.append((edge, count))
            if size.at_least <= count <= size.at_most:
                finished = good(made)
                if finished is not None:
                    return finished
        edge = next(e for e in _proposals(seen, goal, edge) if all(abs(e / old - 1) > 4e-4 for old, _ in seen))
    raise BuildError(f"no mesh with {size.at_least} to {size.at_most} {size.of} in {TRIALS} trials; tried {seen}")


def _proposals(seen: list[tuple[float, int]], goal: float, edge: float) -> Iterator[float]:
    """Edge lengths to try next: where a power law through what was seen meets the goal, then ever farther around it."""
    guess = edge
    if seen:
        near = sorted(seen, key=lambda pair: abs(np.log(pair[1] / goal)))[:3]
        logs = np.log(np.array(near, dtype=float))
        # counts scatter by a per cent from size to size: a slope is fitted only to sizes that are well apart
        slope = 2.0
        if np.ptp(logs[:, 0]) > 0.02:
            slope = float(np.clip(-np.polyfit(logs[:, 0], logs[:, 1], 1)[0], 1.0, 3.0))
        guess = float(np.exp(logs[0, 0] + (logs[0, 1] - np.log(goal)) / slope))
    yield guess
    for step in range(1, 400):
        yield guess * (1 + 0.0013 * step)
        yield guess * (1 - 0.0013 * step)
