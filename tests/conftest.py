"""What all tests share: a quiet Warp, devices and precisions that a test runs on, and the table of verification."""

from __future__ import annotations

import gc
import os
import signal
from collections import defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING

if "PYTEST_XDIST_WORKER" in os.environ:
    # processes of tests that run beside each other have one thread of BLAS each: before NumPy is loaded
    os.environ.setdefault("OMP_NUM_THREADS", "1")

import hypothesis
import pytest
import warp as wp
from drawn_for_commit import ALL, SOME, files_for_this_commit
from verification_rows import Row, Rows

from warpbrain.kernels.module import PRECISIONS, Precision

if TYPE_CHECKING:
    from warpbrain.diagnosis.result import Diagnosis

wp.config.log_level = wp.LOG_WARNING
# on a busy machine any example may take longer than the 200 ms that Hypothesis allows
hypothesis.settings.register_profile("no deadline", hypothesis.settings(), deadline=None)
hypothesis.settings.load_profile("no deadline")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--verification-rows", metavar="FILE", help="write the rows of docs/verification.md to a JSON file"
    )


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--verification-rows"):
        os.environ[ALL] = "1"
    config.stash[ROWS] = Rows()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Thousands of tests that are collected are no garbage: none is looked for among them, now or while they run, when
    it is looked for less often than by default, where it took a fortieth of the time."""
    gc.disable()
    collected = yield
    gc.freeze()
    gc.enable()
    gc.set_threshold(10_000)
    return collected


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if SOME in os.environ and ALL not in os.environ:
        _leave_to_other_commits(config, items)
    for item in items:
        if "verify" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.verification)
    # the longest first, so that no process of pytest-xdist is left with one of them at the end
    items.sort(key=_slowness, reverse=True)


def _leave_to_other_commits(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect slow tests of files that do not run with this commit: tests of one file share what they set up."""
    slow, seconds = [item for item in items if item.get_closest_marker("slow")], defaultdict[str, float](float)
    for item in slow:
        seconds[item.location[0]] += _slowness(item)
    run = files_for_this_commit(seconds)
    left = {item for item in slow if item.location[0] not in run}
    config.hook.pytest_deselected(items=list(left))
    items[:] = [item for item in items if item not in left]


def _slowness(item: pytest.Item) -> float:
    """Processor seconds [s] that the marker `slow` gives, roughly; 0 without."""
    marker = item.get_closest_marker("slow")
    return float(marker.args[0]) if marker and marker.args else 0.0


def pytest_sessionfinish(session: pytest.Session) -> None:
    rows = session.config.stash[ROWS]
    if hasattr(session.config, "workeroutput"):
        # a process of pytest-xdist, which hands its rows to the one that it works for
        session.config.workeroutput["verification"] = rows.as_dicts()
    elif file := session.config.getoption("--verification-rows"):
        rows.write(file)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: object) -> None:
    rows = node.config.stash[ROWS]
    rows.add_dicts(getattr(node, "workeroutput", {}).get("verification", []))


ROWS = pytest.StashKey[Rows]()


@pytest.fixture
def verify(request: pytest.FixtureRequest) -> Iterator[Row]:
    """Asserts that a number lies within a bound of its reference, as a row of docs/verification.md."""
    row = Row(request.node.nodeid)
    yield row
    request.config.stash[ROWS].add(row)


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


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C reaches what a test starts, where the tests run in the background of a shell that ignores it, too."""
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def undrawn() -> Iterator[None]:
    """Neither bodies nor curves are drawn, which takes most of the time of a small case (`not_drawn`)."""
    from not_drawn import nothing_drawn

    with nothing_drawn():
        yield


@pytest.fixture(scope="session")
def small_diagnosis(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """A block of gel that sinks, diagnosed once for all tests (`sinking_block`)."""
    from sinking_block import diagnose_sinking

    return diagnose_sinking(tmp_path_factory.mktemp("sinking") / "case")
