"""Factors of the tangent stiffness of a shipped brain: RSLAB beside SciPy's SuperLU, one thread, processor time.

python bench/factors.py [CASE]   # prints medians of seven, in turns
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from typing import Any

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
from scipy.sparse.linalg import splu

from warpbrain.cases.shipped import find_case
from warpbrain.simulation.factors import SparseFactors
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System


def seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time of some work, and what it returns."""
    began = time.process_time()
    done = work()
    return time.process_time() - began, done


def superlu(matrix: Any) -> Any:
    """Symmetric mode, minimum degree: the fastest of its settings for these matrices."""
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def main() -> None:
    """Print the table."""
    system = System(model_of(find_case(sys.argv[1] if len(sys.argv) > 1 else "0529", "multi")), "cpu")
    free = ~system.model.constrained.ravel()
    matrix = system.stiffness().tocsr()[free][:, free]
    columns = np.asfortranarray(np.random.default_rng(0).normal(size=(len(matrix.indptr) - 1, 64)))
    times: dict[str, list[tuple[float, float]]] = {"RSLAB": [], "SuperLU": []}
    for _ in range(8):
        for name, factorise in (("RSLAB", SparseFactors), ("SuperLU", superlu)):
            made, factors = seconds(lambda factorise=factorise: factorise(matrix))
            solved, _ = seconds(
                lambda factors=factors: [factors.solve(columns[:, k : k + 16]) for k in range(0, 64, 16)]
            )
            times[name].append((made, solved))
    print(f"{matrix.shape[0]} rows, {matrix.nnz} entries")
    for name, runs in times.items():
        made, solved = np.median(runs[1:], axis=0)
        print(f"{name:8} factors {1e3 * made:6.0f} ms, 64 solutions {1e3 * solved:6.0f} ms")


if __name__ == "__main__":
    main()
