"""Pardiso of Intel's MKL for symmetric positive definite matrices, as a sparse direct solver for codes that take one.

Optional: `pip install pypardiso`. MKL is free of charge, not open source; nothing but this comparison uses it.
"""

import pypardiso
from scipy.sparse import triu

NAME = f"Pardiso (pypardiso {pypardiso.__version__})"

#: Real, symmetric, positive definite: Cholesky, of the upper triangle.
_solver = pypardiso.PyPardisoSolver(mtype=2)


def spsolve(A, b):
    """Solve a system."""
    return pypardiso.spsolve(triu(A, format="csr"), b, solver=_solver)
