"""The laws of FEBio's test problems at material points: stiffness against differences of the stress."""

from pathlib import Path

import numpy as np
import pytest
from material_point import random_gradients

from febio.materials import constitution
from febio.points import Points
from febio.problem import read_problems

# what they are for, test_febio.py, is slow, too
pytestmark = pytest.mark.slow(1)

PROBLEMS = read_problems(Path(__file__).parents[1] / "verification" / "data" / "febio")
LAWS = {material["type"]: (problem, name) for problem in PROBLEMS for name, material in problem.materials.items()}


@pytest.mark.parametrize("kind", sorted(LAWS))
def test_stiffness_is_the_derivative_of_the_stress(kind):
    problem, name = LAWS[kind]
    part = constitution(problem, name, problem.end)
    F = random_gradients(3, amount=0.1)
    points = Points(part, len(F), "cpu")
    change = np.random.default_rng(0).normal(size=F.shape)
    step = 1e-6
    (plus, _), (minus, _) = points.evaluate(F + step * change), points.evaluate(F - step * change)
    _P, A = points.evaluate(F)
    expected = (plus - minus) / (2.0 * step)
    found = np.einsum("nijkl,nkl->nij", A, change)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())
