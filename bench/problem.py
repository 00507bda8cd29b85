"""The problem that every code solves, when it is solved, and the row that a code reports."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable

import numpy as np

MU, NU, STRETCH = 1.0, 0.45, 0.2
#: Cells along an edge, six tetrahedra each; `growth.py` asks for others than those whose answer is known.
KNOWN = 12
CELLS = int(os.environ.get("CUBE_CELLS", KNOWN))
BULK = 2.0 * MU * (1.0 + NU) / (3.0 * (1.0 - 2.0 * NU))
#: Reaction of the top face and norm of the nodal displacements, as found by seven codes to 14 digits.
REACTION, NORM = 0.5893281763701914, 5.852024036743839
#: Solved when the out-of-balance forces are at most this part of all internal forces, reactions included (2-norms).
TOLERANCE = 1e-8
#: What a code does beside one solution: evaluate the tangent again and again, to time it. Not in a whole process.
ASSEMBLIES = "assembly" in sys.argv

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


def imbalance(internal: np.ndarray, free: np.ndarray) -> float:
    """The norm that every code stops by: out-of-balance forces on free components over all internal forces."""
    return float(np.linalg.norm(internal[free]) / np.linalg.norm(internal))


def internal_forces(nodes: np.ndarray, tetrahedra: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Of each node (n, 3), by an evaluation that belongs to none of the codes."""
    edges = (nodes[tetrahedra[:, 1:]] - nodes[tetrahedra[:, :1]]).transpose(0, 2, 1)
    moved = nodes + displacement
    F = (moved[tetrahedra[:, 1:]] - moved[tetrahedra[:, :1]]).transpose(0, 2, 1) @ np.linalg.inv(edges)
    J, H = np.linalg.det(F)[:, None, None], np.linalg.inv(F).transpose(0, 2, 1)
    I1 = np.einsum("eij,eij->e", F, F)[:, None, None]
    P = MU * J ** (-2.0 / 3.0) * (F - I1 / 3.0 * H) + BULK * (J - 1.0) * J * H
    # forces on nodes 1 to 3: P times the gradients of their shape functions times the volume
    forces = np.linalg.det(edges)[:, None, None] / 6.0 * P @ np.linalg.inv(edges).transpose(0, 2, 1)
    internal = np.zeros_like(nodes)
    for corner in range(3):
        np.add.at(internal, tetrahedra[:, corner + 1], forces[:, :, corner])
        np.add.at(internal, tetrahedra[:, 0], -forces[:, :, corner])
    return internal


def free_nodes(nodes: np.ndarray) -> np.ndarray:
    """Which nodes (n,) are neither of the bottom nor of the top."""
    free = np.ones(len(nodes), dtype=bool)
    free[np.concatenate(faces(nodes))] = False
    return free


def seconds(work: Callable[[], object], repeats: int = 7) -> float:
    """Smallest processor time of some work [s]; machines are shared, so wall time would measure the neighbours."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def report(
    code: str,
    version: str,
    solver: str,
    displacement: np.ndarray,
    mesh: tuple[np.ndarray, np.ndarray] | None = None,
    **figures: float | int | None,
) -> None:
    """Print one JSON line; refuses an answer that is wrong or not solved to `TOLERANCE`.

    `mesh` is the nodes and tetrahedra of a code that numbers them anew. A code whose displacement is printed with fewer
    digits than the tolerance says itself what its `imbalance` is.
    """
    nodes, tetrahedra = mesh or cube()
    internal = internal_forces(nodes, tetrahedra, displacement)
    errors = {}
    if CELLS == KNOWN:
        reaction = float(internal[faces(nodes)[1], 2].sum())
        errors = {
            "u_norm_error": abs(float(np.linalg.norm(displacement)) / NORM - 1.0),
            "reaction_error": abs(reaction / REACTION - 1.0),
        }
    for name, error in errors.items():
        if not error <= 1e-6:
            sys.exit(f"{code}: wrong answer: {name} {error:.1e}")
    figures.setdefault("imbalance", imbalance(internal, free_nodes(nodes)))
    if not figures["imbalance"] <= TOLERANCE:
        sys.exit(f"{code}: not solved: out-of-balance forces {figures['imbalance']:.1e}, goal {TOLERANCE:.0e}")
    row = {
        "code": code,
        "version": version,
        "linear_solver": solver,
        "threads": os.environ.get("OMP_NUM_THREADS", "default"),
        **errors,
        **figures,
    }
    print(json.dumps(row))
