"""The coarse phantom against what quadratic tetrahedra of another code and another mesh say: a few repetitions."""

import sys
from pathlib import Path

import pytest

from warpbrain.estimation.estimate import EstimationOptions

BENCH = Path(__file__).parents[2] / "bench"


@pytest.fixture
def concealed(monkeypatch: pytest.MonkeyPatch):
    """The experiment, whose truth was computed once and is kept beside it."""
    pytest.importorskip("felupe")
    monkeypatch.syspath_prepend(str(BENCH))
    import concealed_phantom

    yield concealed_phantom
    for name in ("concealed_phantom", "phantom_truth"):
        sys.modules.pop(name, None)


def test_tissue_is_found_from_another_mesh_and_another_code(concealed) -> None:
    found = concealed.experiment("single", 3, EstimationOptions(samples=25))
    assert found["covered"][0] >= 2 and found["first"]["covered"] == [True]
    assert found["rmse_mm"]["median"] < 0.1
    assert not found["without_error_of_mesh"]["covered"][0]
    assert found["pareto_k"] < 0.7
