"""The folder of a diagnosis, as the command leaves it."""

from pathlib import Path

import pytest
from sinking_block import OPTIONS

from warpbrain.report.diagnosis.description import describe_diagnosis
from warpbrain.report.diagnosis.files import write_map
from warpbrain.report.diagnosis.html import write_page
from warpbrain.report.diagnosis.points import write_covariance, write_points
from warpbrain.report.files import write_summary
from warpbrain.report.state_files import write_diagnosed_state


@pytest.fixture(scope="session")
def diagnosed(small_diagnosis, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("diagnosed")
    write_map(folder / "map.vtu", small_diagnosis)
    write_diagnosed_state(folder / "state.vtu", small_diagnosis)
    write_points(folder / "points.csv", small_diagnosis)
    write_covariance(folder / "covariance.npz", small_diagnosis)
    write_summary(folder / "diagnosis.json", describe_diagnosis(small_diagnosis, OPTIONS, "cpu"))
    write_page(folder)
    return folder
