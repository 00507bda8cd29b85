"""The problem that every code solves, and the row that it reports."""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from collections.abc import Callable

import numpy as np

MU, NU, STRETCH, CELLS = 1.0, 0.45, 0.2, 12
BULK = 2.0 * MU * (1.0 + NU) / (3.0 * (1.0 - 2.0 * NU))
#: Reaction of the top face and norm of the nodal displacements, as found by seven codes to 14 digits.
REACTION, NORM = 0.5893281763701914, 5.852024036743839

_CORNER_PATHS = ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))


def cube(cells: int = CELLS) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) and positively oriented Kuhn tetrahedra (m, 4) of the unit cube."""
    x = np.linspace(0.0, 1.0, cells + 1)
    nodes = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    stride = np.array([(cells + 1) ** 2, cells + 1, 1])
    corner = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) @ stride
    # six paths along the edges from one corner of a cell to the opposite one
    tetrahedra = np.concatenate(
        [np.stack([corner + stride[list(path[:k])].sum() for k in range(4)], axis=1) for path in _CORNER_PATHS]
    )
    edges = nodes[tetrahedra[:, 1:]] - nodes[tetrahedra[:, :1]]
    inverted = np.linalg.det(edges) < 0.0
    tetrahedra[inverted] = tetrahedra[inverted][:, [0, 2, 1, 3]]
    return nodes, tetrahedra


def faces(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Node ids of bottom and top."""
    return np.flatnonzero(nodes[:, 2] < 1e-12), np.flatnonzero(nodes[:, 2] > 1.0 - 1e-12)


def seconds(work: Callable[[], object], repeats: int = 7) -> float:
    """Smallest processor time of some work [s]; machines are shared, so wall time would measure the neighbours."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def report(code: str, version: str, solver: str, displacement: np.ndarray, **figures: float | int | None) -> None:
    """Print one JSON line; refuses a wrong answer."""
    norm = float(np.linalg.norm(displacement))
    if abs(norm / NORM - 1.0) > 1e-6:
        sys.exit(f"{code}: wrong answer: |u| = {norm:.10g}, expected {NORM:.10g}")
    row = {
        "code": code,
        "version": version,
        "linear_solver": solver,
        "u_norm_error": abs(norm / NORM - 1.0),
        "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "threads": os.environ.get("OMP_NUM_THREADS", "default"),
        **figures,
    }
    print(json.dumps(row))
