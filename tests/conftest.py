"""What all tests share: a quiet Warp, and the devices and precisions that a test runs on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest
import warp as wp

from warpbrain.kernels.precision import PRECISIONS, Precision

if TYPE_CHECKING:
    from warpbrain.diagnosis.result import Diagnosis

wp.config.log_level = wp.LOG_WARNING

DEVICES = ["cpu"]
if wp.get_cuda_device_count() > 0:
    DEVICES.append(pytest.param("cuda:0", marks=pytest.mark.gpu))


@pytest.fixture(scope="session", params=DEVICES)
def device(request: pytest.FixtureRequest) -> str:
    """Warp device: the CPU, and the first GPU where there is one."""
    return request.param


@pytest.fixture
def gpu(device: str) -> wp.Device:
    """A GPU for which CuPy is there."""
    if device == "cpu":
        pytest.skip("on a GPU only")
    pytest.importorskip("cupy")
    return wp.get_device(device)


@pytest.fixture(scope="session", params=list(PRECISIONS))
def precision(request: pytest.FixtureRequest) -> Precision:
    return PRECISIONS[request.param]


@pytest.fixture(autouse=True)
def _default_device(request: pytest.FixtureRequest) -> Iterator[None]:
    """Arrays that a test makes without naming a device go where the test runs."""
    name = request.getfixturevalue("device") if "device" in request.fixturenames else "cpu"
    with wp.ScopedDevice(name):
        yield


@pytest.fixture(scope="session")
def small_diagnosis(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """A block of gel that sinks, diagnosed once for all tests (`sinking_block`)."""
    from sinking_block import diagnose_sinking

    return diagnose_sinking(tmp_path_factory.mktemp("sinking") / "case")
