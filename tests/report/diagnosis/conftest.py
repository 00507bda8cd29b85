"""The folder of a diagnosis, as the command leaves it."""

from pathlib import Path

import pytest
from sinking_block import OPTIONS

from warpbrain.atomic import write_text
from warpbrain.report.diagnosis.description import describe
from warpbrain.report.diagnosis.files import write_covariance, write_diagnosed_state, write_map, write_points
from warpbrain.report.diagnosis.page import page_of
from warpbrain.report.files import read_state, write_summary


@pytest.fixture(scope="session")
def summary(small_diagnosis) -> dict:
    return describe(small_diagnosis, OPTIONS, "cpu")


@pytest.fixture(scope="session")
def diagnosed(small_diagnosis, summary, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("diagnosed")
    write_map(folder / "map.vtu", small_diagnosis)
    write_diagnosed_state(folder / "state.vtu", small_diagnosis)
    write_points(folder / "points.csv", small_diagnosis)
    write_covariance(folder / "covariance.npz", small_diagnosis)
    write_summary(folder / "diagnosis.json", summary)
    write_text(folder / "report.html", page_of(small_diagnosis, summary, read_state(folder / "state.vtu")))
    return folder
